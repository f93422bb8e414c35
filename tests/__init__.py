import pytest

# failed assertions of helpers are told in full, too
pytest.register_assert_rewrite("tests.exchange", "tests.fuzz", "tests.lowlevel", "tests.native", "tests.shell")
