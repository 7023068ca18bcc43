"""FREE: holds nothing; it names two markers for motions and requests."""

from __future__ import annotations

from mbsim.joints.catalog import joint

joint("FREE")
