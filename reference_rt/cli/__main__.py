"""`python -m reference_rt.cli`."""

from reference_rt.cli.main import main

if __name__ == "__main__":
    main()
