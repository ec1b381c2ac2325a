"""``python -m coordlang``: the command line."""

from coordlang.cli import main

if __name__ == "__main__":
    main()
