"""What a function does to the arrays that it is given, followed along every path of its syntax tree."""
