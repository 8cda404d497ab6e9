"""The commands, one file each: what its help says, its arguments, and a thin layer over the API.

Every module has SUMMARY, USAGE, DESCRIPTION, EXAMPLES, `configure(parser)` and `run(args)`. All
that is heavy is imported inside `run`.
"""
