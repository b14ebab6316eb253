"""How much of each effect a format holds: its error less the best approximation by the format's parameters."""

from collections.abc import Callable, Sequence

import numpy as np

from ptt.correct.exports.format import NOTHING_TO_GAIN, USELESS, ErrorLeft
from ptt.correct.exports.left import WorkspaceSample
from ptt.correct.terms import split_terms
from ptt.effects import Effect
from ptt.effects.phrases import listed
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.axes import rms_length
from ptt.run.table import Table
from ptt.run.viewing import build_view

HELD = 0.05  # residual share of an effect's error up to which it counts as held
NOTHING = 1e-6  # um: less is rounding
LOAD_KG = 1.0  # assumed where no payload is stated, to find effects that act under a payload alone
UNSTATED = "the format has no payload, and none is given here; --run RUN.csv evaluates it at the loads of a run"
SHOWN_UM = 0.05  # less is printed as 0.0
ALMOST_ALL = 0.95  # share of an effect's error that counts as all of it
APART = "its table entries are too far apart for it, or it does not depend on one axis position alone"
TOLD = {"payload": "payload_kg", "temperature": "temp_c", "speed": "feed_mm_s"}  # context -> the run's column of it
JUDGED_AT = {  # context -> where errors are judged that no run states it for
    "payload": "without a payload",
    "temperature": "at the reference temperature",
    "speed": "at rest",
    "time": "at the start",
}
CONTEXTS = {
    "payload": "the format has no payload",
    "temperature": "the format has no temperature",
    "speed": "the format has no speed",
    "time": "the format has no time",
    "direction": "the format does not remember from which side a joint came",
}


def cannot_hold(
    sample: WorkspaceSample,
    tangent: np.ndarray,
    shape: str,
    *,
    known: Sequence[str] = (),
    hints: dict[str, str] | None = None,
    tabled: Callable[[Effect], np.ndarray] | None = None,
) -> dict[str, str]:
    """Find the effects that a format cannot hold, and say why.

    The tool's shift by each effect alone is projected onto the column space of the format's parameters (first order).

    Args:
        sample: places and model.
        tangent: (n, 3, P), derivative of the tool by each parameter of the format.
        shape: what the format has no place for, as a reason.
        known: contexts that the format knows, of `CONTEXTS`.
        hints: name of an effect -> what else a user can do about it.
        tabled: shift of each joint by an effect as tables along the joints represent it, (n, k).

    Returns:
        Key -> why.
    """
    model = sample.compensator.model
    steady, reversing, _ = split_terms(model)
    terms = [*steady, *reversing]
    view = build_view(model.file, sample.table.replace(command=sample.commands.q))
    whole = predict(terms, view).p
    basis = np.linalg.qr(_scaled(tangent.reshape(whole.numel(), -1)))[0]
    by_joint = view.jacobian.numpy()
    unloaded = set() if "payload" in known else _unloaded(sample)
    why = dict.fromkeys(unloaded, UNSTATED)
    for effect, _ in terms:
        if effect.key in unloaded:
            continue
        without = predict([item for item in terms if item[0] is not effect], view).p
        moved = (whole - without).numpy().ravel()
        rest = moved if tabled is None else moved - np.einsum("nck,nk->nc", by_joint, tabled(effect)).ravel()
        left = rest - basis @ (basis.T @ rest)
        lacking = APART if tabled is not None and effect.stage == "drive" else shape
        reason = _reason(effect, moved, left, lacking, known, untold=_untold(effect, sample))
        if reason:
            hint = (hints or {}).get(effect.name)
            why[effect.key] = f"{reason}; {hint}" if hint else reason
    return why


def share_without_payload(sample: WorkspaceSample) -> dict[str, float]:
    """Share of each effect that acts without a payload.

    Args:
        sample: places and model; where no payload is stated, a payload of 1 kg is tried.

    Returns:
        Key -> share of its shift under payload; 1 for an effect that does not depend on payload.
    """
    model = sample.compensator.model
    stated = sample.table.payload_kg
    loads = stated if stated is not None and _stated(sample) else np.full(len(sample.targets), LOAD_KG)
    command = sample.commands.q
    views = [
        build_view(model.file, sample.table.replace(command=command, payload_kg=each)) for each in (loads, 0.0 * loads)
    ]
    shares = {}
    for effect, values in split_terms(model)[0]:
        loaded, bare = ((predict([(effect, values)], view).p - predict([], view).p).numpy().ravel() for view in views)
        shares[effect.key] = 1.0 - rms_um(loaded - bare) / max(rms_um(loaded), NOTHING)
    return shares


def _stated(sample: WorkspaceSample) -> bool:
    return sample.table.payload_kg is not None and bool(np.nan_to_num(sample.table.payload_kg).any())


def _unloaded(sample: WorkspaceSample) -> set[str]:
    """Effects that act only under a payload, where none is stated, so that they cannot be judged."""
    return set() if _stated(sample) else {key for key, share in share_without_payload(sample).items() if share < HELD}


def network_note(sample: WorkspaceSample) -> tuple[str, ...]:
    """Note of a format without network where the model has one."""
    if sample.compensator.network is None:
        return ()
    return ("the network's part is included only as far as the format's parameters can reproduce it",)


def _untold(effect: Effect, sample: WorkspaceSample) -> bool:
    """Whether an effect needs a context that a run would state and the sample does not."""
    return any(context in TOLD for context in untold_contexts(effect, sample.table))


def untold_contexts(effect: Effect, table: Table | None) -> tuple[str, ...]:
    """Contexts that an effect needs and nothing states; time never is.

    Args:
        effect: of the model.
        table: rows at which errors are judged; None for none.
    """
    told = {context for context, column in TOLD.items() if table is not None and getattr(table, column) is not None}
    return tuple(context for context in effect.requires if context in JUDGED_AT and context not in told)


def untold_note(model: Model, table: Table | None) -> tuple[str, ...]:
    """Note on effects whose error is judged where it may be next to nothing, for lack of what they depend on.

    Args:
        model: what is exported.
        table: rows at which errors are judged; None for none.
    """
    steady, reversing, _ = split_terms(model)
    needs = {effect.key: untold_contexts(effect, table) for effect, _ in (*steady, *reversing)}
    keys = [key for key, contexts in needs.items() if contexts]
    if not keys:
        return ()
    contexts = [context for context in JUDGED_AT if any(context in needs[key] for key in keys)]
    run = "; --run RUN.csv judges at those of a run" if set(contexts) & set(TOLD) else ""
    return (
        f"{listed(keys)} {'depend' if len(keys) > 1 else 'depends'} on {listed(contexts)}, which nothing states here: "
        f"the figures are {listed([JUDGED_AT[context] for context in contexts])}, and the machine may miss by far more "
        f"elsewhere{run}",
    )


def useless_note(sample: WorkspaceSample, left: ErrorLeft, holds: Sequence[str]) -> tuple[str, ...]:
    """Note of a format without advice of its own, where the file corrects nothing.

    Args:
        sample: places and model.
        left: remaining error of the file.
        holds: keys of the effects that it holds; none is said where one of them was judged without what it depends on.
    """
    model = sample.compensator.model
    acting = {term.effect.key for term in model.terms if untold_contexts(term.effect, sample.table)}
    empty = not model.terms and sample.compensator.network is None
    if left.corrects or not np.isfinite(left.format) or empty or acting & set(holds):
        return ()
    return (f"{USELESS}; send what `ptt predict` works out" if left.gains else NOTHING_TO_GAIN,)


def _reason(
    effect: Effect, moved: np.ndarray, left: np.ndarray, shape: str, known: Sequence[str], *, untold: bool
) -> str:
    unknown = [CONTEXTS[context] for context in effect.requires if context in CONTEXTS and context not in known]
    figures = said_left(rms_um(moved), rms_um(left), untold=untold)
    if unknown:
        return f"{' and '.join(unknown)} ({figures})"
    return "" if rms_um(left) <= HELD * rms_um(moved) else f"{shape} ({figures})"


def said_left(whole: float, left: float, *, untold: bool = False) -> str:
    """How much of an effect's error a format leaves, in words.

    Args:
        whole: its error, um rms.
        left: what the format leaves of it, um rms.
        untold: whether it depends on something of which no run was given.
    """
    if whole < SHOWN_UM and untold:
        return (
            "it causes no error at rest and at the reference temperature, where it is judged unless --run names a run"
        )
    if whole < SHOWN_UM:
        return f"its whole error is less than {SHOWN_UM:g} um"
    if left > ALMOST_ALL * whole:
        return f"all of its {whole:.1f} um remain"
    return f"{left:.1f} um of its {whole:.1f} um remain; the rest is in the file"


def rms_um(shift: np.ndarray) -> float:
    """Root mean square length of shifts (3 n,) mm, um."""
    return 1e3 * rms_length(shift.reshape(-1, 3))


def _scaled(columns: np.ndarray) -> np.ndarray:
    """Non-zero columns scaled to unit length, so that units of parameters do not matter."""
    size = np.linalg.norm(columns, axis=0)
    return columns[:, size > 0.0] / size[size > 0.0]
