"""The checks of the exercises in the notebooks, by notebook and exercise: "4.2" is notebook 4, exercise 2.

What a check is and says: `lab`.
"""
