"""From where the prior variances of an effect in the model are learned."""

from dataclasses import replace

import numpy as np

from ptt.challenge.challenge import bench
from ptt.challenge.truth import table_of
from ptt.diagnosis.evidence.effect_atoms import atoms_of
from ptt.effects import library
from ptt.fitting.linear import linear_columns
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem


def test_they_begin_at_the_fitted_sizes_and_at_the_usual_ones_where_these_are_larger():
    """A knock by 20 mrad is hundreds of its usual sizes; slips that are not there are less than theirs."""
    machine = bench()
    drawn = draw_rig(4, machine, "volume", rows=50)
    knock = {"knock_row": 29, "knock_um": (-180.0, 300.0, -187.0), "knock_mrad": (20.0, 13.7, 1.9)}
    rig = replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update=knock))
    problem = build_problem(machine, table_of(simulate(rig, drawn.targets).frame, drawn.absent))
    effects = library()
    fitted = fit(Model(machine) + effects["setup-jump"](), problem, robust=False)
    candidates = [effects["backlash"]()]
    atoms = atoms_of(linear_columns(fitted, problem, candidates, fitted.noise), fitted, problem, candidates)
    jump, play = atoms["setup-jump"], next(atom for atom in atoms.values() if atom.name == "backlash")
    values = fitted.unknowns[: len(jump.columns)]
    assert jump.first_variances == np.square(values).mean() and jump.first_variances > 1e4
    assert (play.first_variances == 1.0).all()
