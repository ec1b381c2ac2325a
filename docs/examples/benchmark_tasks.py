# SPDX-License-Identifier: GPL-3.0-or-later
"""A benchmark over tasks: words, bounds and seconds of several methods on several domains.

Run it as a script in the root of the repository, or cell by cell (``# %%``).
"""

# %% The domains, each with its problem, and the methods that are compared.
import coordlang

DOMAINS = ("t-map", "three-cells", "handover")
METHODS = ("greedy", "separating", "minimal")
SECONDS = 60


def problem_of(domain: str) -> str:
    """The first problem of a shipped domain."""
    names = {"handover": "exchange"}
    return f"domains/{domain}/{names.get(domain, 'problem')}.pddl"


# %% One run: the language for the problem's task, within a time limit.
rows = []
for domain in DOMAINS:
    loaded = coordlang.load(f"domains/{domain}/domain.pddl", problem_of(domain))
    for method in METHODS:
        try:
            with coordlang.time_limit(SECONDS):
                built = coordlang.build(loaded, method=method)
        except coordlang.OutOfTime:
            rows.append((domain, method, "-", "-", f"> {SECONDS}"))
            continue
        seconds = f"{sum(built.seconds.values()):.2f}"
        rows.append((domain, method, built.guarantee.size, built.guarantee.lower_bound, seconds))
        assert coordlang.verify(built.language, loaded)

# %% The table.
print(f"{'domain':14}{'method':12}{'words':>6}{'at least':>10}{'seconds':>9}")
for domain, method, words, bound, seconds in rows:
    print(f"{domain:14}{method:12}{words:>6}{bound:>10}{seconds:>9}")
