"""The command line: arguments in, files and words out. One thin file a command.

Nothing heavy is imported before a command runs: `mcloc --help` has to answer at once.
"""
