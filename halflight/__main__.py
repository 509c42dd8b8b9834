"""`python -m halflight` is `halflight`."""

from halflight.cli import main

if __name__ == "__main__":
    main()
