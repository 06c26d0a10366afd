"""LLVM IR becomes C."""
