"""Native code for the rules of a fleet, through LLVM: symbols, kernels, lowering, formulas, assembly."""
