# SPDX-License-Identifier: GPL-3.0-or-later
"""A first language: is coordination required, the smallest language, and what its words mean.

Run it as a script in the root of the repository, or cell by cell (``# %%``).
"""

# %% Two robots on a T-shaped map trade places: there are two optimal plans.
import coordlang

files = "domains/t-map/domain.pddl", "domains/t-map/problem.pddl"
plans = coordlang.plans(*files)
print(plans)

# %% If each robot follows a plan of its own choice, they miscoordinate.
coordination = coordlang.coordination(*files)
assert coordination.required
print(coordination)

# %% The smallest language for every task on this map, with proof.
built = coordlang.build(*files, tasks="all", method="minimal")
assert built.guarantee.proved_minimal
assert coordlang.verify(built.language, *files)
print(built)

# %% Each word is a set of joint states, here as a formula.
for word, formula in coordlang.explain(built.language, *files).formulas.items():
    print(word, ":", formula)

# %% The file is all that the robots need.
built.language.save("t-map.json")
