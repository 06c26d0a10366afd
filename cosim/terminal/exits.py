"""What the exit codes of the command line mean."""

DONE = 0
STOPPED = DIFFERENT = UNCERTAIN = 1
BAD_INPUT = 2
VIOLATED = 3
BY_SIGNAL = 128
"""To be added to the number of the signal that ended the program: 130 for Ctrl-C, 143 for SIGTERM, 129 for SIGHUP."""

MEANINGS = """\
exit codes:
  0     done; `compare`, `bisect`: the results agree
  1     a run was stopped by a block, diverged or could not be recorded; `compare`, `bisect`: they differ;
        `accuracy`, `run --error`: a figure depends on the step, or nobody can tell its error;
        `run`: a requirement is undecided;
        `study`, `report`: not one member has come to its end
  2     bad input, or a file that cannot be read or written
  3     a run, or a member of a study, violates a requirement of its diagram
  128+n ended by signal n: 130 by Ctrl-C, 143 by SIGTERM, 129 by SIGHUP; what was recorded is kept
"""
