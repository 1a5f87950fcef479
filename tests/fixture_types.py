"""Short names for the types of pytest's fixtures, so that most signatures fit on a line."""

import pytest

Capture = pytest.CaptureFixture[str]
Folders = pytest.TempPathFactory
Log = pytest.LogCaptureFixture
Patch = pytest.MonkeyPatch
