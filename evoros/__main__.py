"""``python -m evoros`` is the command ``evoros``, for programs that start Python modules."""

from evoros.cli.main import main

if __name__ == "__main__":
    main()
