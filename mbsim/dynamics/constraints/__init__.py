"""What joints and motions hold: tree, equations, projection, reactions."""
