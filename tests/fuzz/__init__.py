"""The fuzzer: broken PDDL against the command line. ``python -m tests.fuzz`` runs many mutants."""
