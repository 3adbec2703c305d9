"""The check of test names finds a name that two tests have."""
import json
import unittest

from check_test_names import names_of_two


def shown(*names: str) -> str:
    return json.dumps({"tests": [{"name": name} for name in names]})


class TestNames(unittest.TestCase):
    def test_are_found_where_two_tests_have_one(self):
        self.assertEqual(names_of_two(shown("a", "b", "a", "c", "b", "a")), ["a", "b"])

    def test_of_one_test_each_are_fine(self):
        self.assertEqual(names_of_two(shown("a", "Soak/a", "b")), [])


if __name__ == "__main__":
    unittest.main()
