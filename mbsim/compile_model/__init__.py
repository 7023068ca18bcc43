"""From Model to constant arrays (`Scene`), saved state (`State`) and scratch (`Work`)."""
