"""The static part of a model as an ONNX graph in float64: positions in, commands out; reversal is the caller's."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nets import GaussianRbf
from ptt.correct.exports.c.effects import AHEAD, OWN, parts_of
from ptt.correct.exports.format import Options, Written
from ptt.correct.exports.graph import Graph, Node
from ptt.correct.exports.graph_arm import CONTEXT, inverse_nodes
from ptt.correct.exports.graph_effects import EFFECTS
from ptt.correct.exports.graph_legs import GraphLegs, Vector, intersect_spheres, split_columns
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import useless_note
from ptt.correct.exports.left import error_left, holdings, sample_workspace, solve, without
from ptt.correct.exports.whole import write_all
from ptt.correct.terms import split_terms
from ptt.errors import InputError
from ptt.machine import MachineFile, SerialSpec
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.run.table import make_table
from ptt.run.target_frame import target_frames

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

ROUNDS = 7  # each reduces the error a thousandfold, three hundredfold on a bad machine, so five reach rounding
OPSET, IR = 17, 8  # of 2022: every runtime since then supports them
SIDE = "it depends on the path, which rows of a batch do not have: the caller adds it"


def write(compensator: "Compensator", out: Path, options: Options) -> Written:
    """Write the graph.

    Inputs: p (n, 3) mm; where effects ask for them payload_kg (n, 1) and temp_c (n, 1). Outputs: b (n, 3) mm, and with
    a network inside (n, 1), whether a row lies in its domain. Of an arm q_nominal (n, k) rad goes in, its targets by
    the drawing, and q (n, k) rad comes out. A row out of reach is NaN; travel, singularities and the size of a
    correction are not checked.

    Args:
        compensator: physics, and a network where there is one.
        out: file to write.
        options: where the model came from, and at which loads errors are judged.

    Returns:
        What came of it.

    Raises:
        InputError: the package onnx is not there.
    """
    try:
        import onnx
    except ImportError:
        raise InputError("needs the package onnx", where="--to onnx", fix="pip install 'ptt[export]'") from None
    cannot = _cannot(compensator)
    if compensator.model.file.machine.kind == "serial":
        _require_no_network(compensator)
    sample = sample_workspace(compensator, options)
    model = build_graph(without(compensator, cannot), head_lines(compensator, options))
    onnx.checker.check_model(model)
    written = write_all({out: model.SerializeToString()})
    q = solve(without(sample.compensator, cannot), sample.table).q
    holds, left_out = holdings(sample, cannot)
    left, network = error_left(sample, q), compensator.network is not None
    return Written(written, holds, left_out, left, useless_note(sample, left, holds), network)


def _cannot(compensator: "Compensator") -> dict[str, str]:
    own = parts_of(compensator.model).cannot
    why = {key: text for key, text in own.items() if text in (AHEAD, OWN)}
    _, reversing, _ = split_terms(compensator.model)
    return why | {effect.key: SIDE for effect, _ in reversing}


def build_graph(compensator: "Compensator", head: list[str]) -> Any:
    """Build the graph of a model.

    Args:
        compensator: with nothing but what a graph holds.
        head: lines for its description.

    Returns:
        An onnx.ModelProto.
    """
    if compensator.model.file.machine.kind == "serial":
        return _arm_graph(compensator, head)
    graph = Graph()
    file = compensator.model.file
    stated = Node(graph, "p")
    place = _into_base(stated, file)
    steady, _, _ = split_terms(compensator.model, "none")
    names = {effect.name for effect, _ in steady}
    uses = {need for name in names for need in EFFECTS[name].context}
    inside = None
    asked = place
    if compensator.network is not None:
        step, inside = _network(graph, compensator.network, place)
        asked = place + graph.node("Where", inside, step, np.zeros((1, 3)))
    b = _fixed_point(graph, file, steady, asked, *_context(graph, file, uses))
    inputs = [("p", 3), *_context_inputs(uses)]
    outputs = [("b", b, 3, 11)] + ([("inside", inside, 1, 9)] if inside is not None else [])  # 11 double, 9 bool
    return _model(graph, inputs, outputs, head)


def _arm_graph(compensator: "Compensator", head: list[str]) -> Any:
    """The graph of an arm's model: nominal joint values in, corrected ones out."""
    graph, file = Graph(), compensator.model.file
    arm = build_mechanism(file.machine)
    assert isinstance(arm, Serial) and isinstance(file.machine, SerialSpec)
    steady, _, _ = split_terms(compensator.model, "none")
    uses = {need for effect, _ in steady for need in CONTEXT[effect.name]}
    payload, warmth = _context(graph, file, uses)
    effects = [(effect, theta.numpy()) for effect, theta in steady]
    q = inverse_nodes(graph, arm, file.machine, effects, Node(graph, "q_nominal"), payload, warmth)
    inputs = [("q_nominal", arm.joints), *_context_inputs(uses)]
    return _model(graph, inputs, [("q", q, arm.joints, 11)], head)


def _require_no_network(compensator: "Compensator") -> None:
    if compensator.network is not None:
        fix = "take --to c, or the machine.toml without the network"
        raise InputError("an arm's network is over joint values and not in the graph", where="--to onnx", fix=fix)


def _context(graph: Graph, file: MachineFile, uses: set[str]) -> tuple[Node, Node]:
    """Payload in kg and warmth in K, (n, 1) each; zero where no effect asks for them."""
    payload = Node(graph, "payload_kg") if "payload" in uses else graph.constant([[0.0]])
    warmth = graph.constant([[0.0]])
    if "temperature" in uses:
        warmth = Node(graph, "temp_c") - np.array([[file.machine.reference_temp_c]])
    return payload, warmth


def _context_inputs(uses: set[str]) -> list[tuple[str, int]]:
    named = (("payload", "payload_kg"), ("temperature", "temp_c"))
    return [(name, 1) for need, name in named if need in uses]


def _model(
    graph: Graph, inputs: list[tuple[str, int]], outputs: list[tuple[str, Node, int, int]], head: list[str]
) -> Any:
    for name, value, _, _ in outputs:
        graph.nodes.append(graph.helper.make_node("Identity", [value.name], [name]))
    used = {name for node in graph.nodes for name in node.input}
    constants = [each for each in graph.constants if each.name in used]
    describe = graph.helper.make_tensor_value_info
    body = graph.helper.make_graph(
        graph.nodes, "ptt", [describe(name, 11, ["n", width]) for name, width in inputs],
        [describe(name, kind, ["n", width]) for name, _, width, kind in outputs], constants,
    )  # fmt: skip
    opset = [graph.helper.make_opsetid("", OPSET)]
    return graph.helper.make_model(
        body, opset_imports=opset, ir_version=IR, producer_name="ptt", doc_string="\n".join(head)
    )


def _into_base(stated: Node, file: MachineFile) -> Node:
    (frame,) = target_frames(file, make_table(np.zeros((1, 3))))
    return stated if frame.source == "base" else stated @ frame.rotation.T + frame.origin[None]


def _network(graph: Graph, network: GaussianRbf, place: Node) -> tuple[Node, Node]:
    """The network's step (n, 3) mm and whether a row is in its domain (n, 1)."""
    domain = network.domain
    x = (place - network.input_mean.numpy()[None]) / network.input_scale.numpy()[None]
    square = (x * x).sum()
    centres, sharp = network.centres.numpy(), -0.5 / network.widths.numpy() ** 2
    power = square * sharp[None] + x @ (-2.0 * sharp * centres.T) + (sharp * (centres**2).sum(axis=1))[None]
    node = graph.node("Exp", power)
    slope, threshold = network.slope.detach().numpy(), network.threshold.detach().numpy()
    step = node @ network.weights.detach().numpy() + x @ slope - threshold[None]
    points = domain.points
    apart = square + (points**2).sum(axis=1)[None] - 2.0 * (x @ points.T)
    nearest = graph.node("ReduceMin", apart, axes=[1], keepdims=1)
    room = graph.node("LessOrEqual", (x - (0.5 * (domain.low + domain.high))[None]).abs(), _half(domain)[None])
    boxed = graph.node("Cast", room, to=11).sum()
    near = graph.node("LessOrEqual", nearest, [[domain.reach**2]])
    return step, graph.node("And", near, graph.node("GreaterOrEqual", boxed, [[2.5]]))


def _half(domain: Any) -> np.ndarray:
    return np.asarray(0.5 * (domain.high - domain.low) + domain.room)


def _fixed_point(graph: Graph, file: MachineFile, steady: Any, asked: Node, payload: Node, warmth: Node) -> Node:
    """Commands by fixed-point iteration of the closed-form inverse with the errors of the previous round, (n, 3) mm."""
    mechanism = build_mechanism(file.machine)
    assert isinstance(mechanism, ThreePtt)
    q = settled = _inverse(mechanism, split_columns(asked), None)
    if not steady:
        return q
    drawn = any(EFFECTS[effect.name].drawn for effect, _ in steady)
    for _ in range(ROUNDS):
        p = intersect_spheres(graph, mechanism, q, None) if drawn else None
        legs = GraphLegs(graph, file, mechanism, q, settled, p, payload, warmth)
        for effect, theta in steady:
            EFFECTS[effect.name].add(legs, theta.numpy(), effect)
        goal = [
            axis - shift if shift is not None else axis
            for axis, shift in zip(split_columns(asked), legs.tool, strict=True)
        ]
        settled = _inverse(mechanism, goal, legs)
        q = settled - legs.drive if legs.drive is not None else settled
    return q


def _inverse(mechanism: ThreePtt, p: Vector, legs: GraphLegs | None) -> Node:
    """Closed-form inverse with the shifts of centres, platform and link lengths, (n, 3) mm."""
    foot, rail, link = mechanism.foot.numpy(), mechanism.rail.numpy(), mechanism.link.numpy()
    reach: list[Any] = [p[axis] - foot[None, :, axis] for axis in range(3)]
    length: Any = link[None]
    if legs is not None:
        for axis in range(3):
            for shift in (legs.centre[axis], legs.platform[axis]):
                reach[axis] = reach[axis] if shift is None else reach[axis] - shift
        length = length if legs.length is None else legs.length + length
    along = sum((reach[axis] * rail[None, :, axis] for axis in range(1, 3)), reach[0] * rail[None, :, 0])
    square = reach[0] * reach[0] + reach[1] * reach[1] + reach[2] * reach[2]
    drop = (along * along - square + length * length).sqrt()
    return along + drop if mechanism.above else along - drop
