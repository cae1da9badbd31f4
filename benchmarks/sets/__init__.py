"""The sets that fusion and the choice are judged on: real photos, and towns in four restylings."""
