"""`python -m reference_rt`: the command line."""

from reference_rt.cli.main import main

if __name__ == "__main__":
    main()
