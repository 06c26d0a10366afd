"""The commands, with a line of help each; each is a file in `commands`."""

COMMANDS = {
    "run": "run a diagram and print its metrics",
    "accuracy": "say how wrong a diagram's figures may be",
    "check": "validate a diagram without running it",
    "bisect": "say where the runs of two diagrams part, why, and which key explains what",
    "debug": "stop a run at a moment, in a block's function, in Python's debugger",
    "init": "begin a project of your own, which runs as it is",
    "new": "write a block of your own, with its test",
    "blocks": "list the blocks, look for some, or show one",
    "keys": "list what may be written in a diagram or a study",
    "export": "write blocks of a diagram as an FMU",
    "fmu": "show what an FMU file is",
    "study": "run many variants, grid points and random draws of a diagram",
    "falsify": "search for a run that violates a requirement, and check whether it is real",
    "tune": "find better values of parameters, within bounds, checked with a smaller step",
    "fit": "find the values of parameters with which a diagram comes nearest to measurements, with their intervals",
    "sensitivity": "say how much of a figure's variance each drawn value explains",
    "report": "run studies, and write one HTML file with their tables and pictures",
    "plot": "draw recorded signals, or animate a run",
    "draw": "draw a diagram: blocks, ports and wires",
    "compare": "show results side by side, and where they and their diagrams differ",
}
