# %% [markdown]
# # ptt as a library
#
# What the command line does, the library does, with the same guards and the same words. Cells run in a notebook
# (Jupyter, VS Code) as they stand; `make docs` runs them and writes docs/library.md.

# %% Read a machine and a run
import ptt

model = ptt.load("data/sealed_one/machine.toml")
run = ptt.read("data/sealed_one/run.csv", model)
print(ptt.check(model, run))

# %% What is missing?
found = ptt.diagnose(model, run)
print(found.verdict, found.suggested)
print(found.words)

# %% Add it, and see the error fall
ladder = ptt.add(model, run, *(step[0] for step in found.suggested))
print(ladder.to_frame().round(2).to_string())
print(ladder.model)
ladder.model.save("solved.toml")

# %% Commands for the machine
out = ptt.predict(ladder.model, ptt.read_targets("data/sealed_one/targets.csv", model))
print(out)
out.to_csv("sliders.csv")
