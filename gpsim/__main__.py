"""`python -m gpsim`, as `gpsim`."""

if __name__ == "__main__":  # worker processes import the main module, and are no command line
    from gpsim.cli.entry import main  # type: ignore[import-not-found, unused-ignore]  # cli/ is mapped there

    main()
