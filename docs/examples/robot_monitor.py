# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot with a monitor: it follows its choices under a sentence and changes its mind on the way.

Run it as a script in the root of the repository, or cell by cell (``# %%``).
"""

# %% Before the mission: a language, and each robot's choices under the sentence.
import coordlang

files = "domains/three-cells/domain.pddl", "domains/three-cells/problem.pddl"
language = coordlang.build(*files).language
sentence = coordlang.plan(language, *files, prefer="most-plans").sentence
choices = coordlang.choices(language, *files, sentence)
assert choices.guaranteed
for robot in choices.robots:
    print(robot, "may follow", choices.subplans[robot], "subplans")
choices.save("choices.json")

# %% On the robot: the monitor needs the file and Python's standard library.
monitor = coordlang.Monitor.read("choices.json", "r2")
print("may do:", monitor.allowed())

# %% May it still pass through cell a?  Yes, and it promises to do so.
detour = monitor.can(visit="(at r2 a)")
print(bool(detour), "- one way:", detour.subplan)
monitor.commit(visit="(at r2 a)")

# %% It acts, one of the allowed subactions a step, until it has finished.
while not monitor.finished:
    subaction = monitor.allowed()[0]
    monitor.did(subaction)
    print("step", monitor.step, subaction or "idle")

# %% What is not allowed is an error: after it nothing would be guaranteed.
try:
    coordlang.Monitor.read("choices.json", "r2").did("(move r2 b c)")
except coordlang.NotAllowed as error:
    print(error)
