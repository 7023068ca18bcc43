"""Closed-form pairs, one a file: from two placed shapes to candidate contact points."""
