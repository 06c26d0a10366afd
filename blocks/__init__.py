"""Signal blocks for robust and collision-free formation control of robots with limited information.

One file a concept. Equation numbers, (10), (29), …, are those of *Robust and Collision-Free Formation Control of
Multiagent Systems With Limited Information* (IEEE TNNLS, doi 10.1109/TNNLS.2021.3112679).
"""
