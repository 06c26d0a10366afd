"""Formation control of robots with limited information, the paper's blocks; and the library for any system.

One file a concept. Equation numbers, (10), (29), …, are those of *Robust and Collision-Free Formation Control of
Multiagent Systems With Limited Information* (IEEE TNNLS, doi 10.1109/TNNLS.2021.3112679).
"""
