"""Build hook: a wheel with shipped code is for the Python and platform that it was made on."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class WheelTag(BuildHookInterface):  # type: ignore[misc]  # hatchling is there when building only
    """Name the wheel after this machine where `mbsim warm --target` has left code in it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Set the tag before the wheel is built."""
        if (Path(self.root) / "mbsim" / "shipped_code").is_dir():
            build_data["pure_python"] = False
            build_data["infer_tag"] = True
