# SPDX-License-Identifier: GPL-3.0-or-later
"""Checking a plan and saying it: a plan of another planner, its sentence, what that leaves open.

Run it as a script in the root of the repository, or cell by cell (``# %%``).
"""

# %% A language, as `coordlang build` makes it.
from pathlib import Path

import coordlang

files = "domains/t-map/domain.pddl", "domains/t-map/problem.pddl"
language = coordlang.build(*files, tasks="all", method="minimal").language

# %% A plan file: one subaction a line, with its step.
Path("plan.txt").write_text("""\
0: (move r2 c1-0 c1-1)
1: (move r1 c0-1 c1-1)
1: (move r2 c1-1 c1-2)
2: (move r1 c1-1 c1-0)
2: (move r2 c1-2 c1-1)
3: (move r2 c1-1 c0-1)
""")

# %% It is a plan, it is optimal, and this is its sentence.
said = coordlang.say(language, *files, "plan.txt")
assert said.covered
print(said)

# %% A receiver understands the sentence: any mixture of these plans is optimal.
left = coordlang.understand(language, *files, said.sentence)
print(left.count, "plan is left open:")
print(left.ipc(left[0]))

# %% What is wrong with another plan: it collides, or it wastes a step.
collision = [("(move r1 c0-1 c1-1)", "(move r2 c1-0 c1-1)")]
late = [(None, None), *coordlang.plans(*files)[0]]
for plan in (collision, late):
    try:
        coordlang.say(language, *files, plan)
    except (coordlang.NotAPlan, coordlang.NotOptimal) as error:
        print(error)
