from jamshape.files.vocabulary import renamed


def test_old_names_are_told_apart_and_new_ones_stay():
    assert renamed({"p": 1e-8, "alpha": 4.0}) == {"pressure": 1e-8, "alpha": 4.0}
    old = {"p": 1.5, "w1": 1.0, "w2": 1.0, "pressure": 1e-6}
    new = {"exponent": 1.5, "w1": 1.0, "w2": 1.0, "pressure": 1e-6}
    assert renamed(old) == renamed(renamed(old)) == renamed(new) == new
