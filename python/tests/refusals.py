"""What the tests share."""

import unittest


class Refusing(unittest.TestCase):
    """A test of calls that are refused in one sentence."""

    def refused(self, kind, words, call, /, *arguments, **keywords):
        with self.assertRaises(kind) as caught:
            call(*arguments, **keywords)
        sentence = str(caught.exception)
        self.assertIn(words, sentence)
        self.assertNotIn("\n", sentence)
