"""Contact patches of closed triangle meshes that need not be convex, compiled."""
