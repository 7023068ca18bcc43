"""Many loops of joints: their multipliers and least reactions, by sparse factors."""
