"""Master algorithms: what UPDATE and ADVANCE leave to choose between two communication points. A method is one file."""
