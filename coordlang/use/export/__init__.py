"""Task and sentence for the programs of others: plain PDDL for planners, a formula for checkers."""
