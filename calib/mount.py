"""Where a camera may sit; apart from `calib.views`, for those who name it without any arrays."""

from typing import Literal

Mount = Literal["eye_in_hand", "eye_to_hand"]
