import numpy as np
import pytest

from jamshape.measures.onset import fit_onset

PHI_J, SLOPE = 0.8412, 0.3


def line(phi, phi_J=PHI_J, slope=SLOPE):
    return slope * np.maximum(phi - phi_J, 0)


def rounded(phi, width):
    """A line with a foot: slope / 2 at phi_J, and p = slope width / 2 there."""
    t = phi - PHI_J
    return SLOPE / 2 * (t + np.hypot(t, width))


@pytest.mark.parametrize("rows", [60, 200, 3000])
def test_line_comes_back_to_rounding(rows):
    phi = np.linspace(0.4, 0.9, rows)
    fit = fit_onset(phi, line(phi))
    assert fit.phi_J == pytest.approx(PHI_J, abs=1e-13)
    assert fit.slope == pytest.approx(SLOPE, rel=1e-11)
    assert 0 < fit.phi_J_error < 1e-12
    assert phi[fit.first - 1] <= PHI_J < phi[fit.first]
    assert fit.last == rows - 1


def test_units_of_pressure_do_not_matter():
    phi = np.linspace(0.8, 0.9, 300)
    p = rounded(phi, 1e-3) + 1e-5 * np.sin(1e4 * phi)
    one, other = fit_onset(phi, p), fit_onset(phi, 2.0**40 * p)
    assert other == one._replace(slope=2.0**40 * one.slope)


@pytest.mark.parametrize("rows", [100, 400, 2000])
@pytest.mark.parametrize("width", [1e-5, 1e-4, 1e-3, 1e-2])
def test_foot_of_a_finite_rate_is_left_out(width, rows):
    phi = np.linspace(0.4, 0.9, rows)
    fit = fit_onset(phi, rounded(phi, width))
    assert phi[fit.first] > PHI_J + width
    assert fit.phi_J == pytest.approx(PHI_J, abs=0.2 * width)
    assert abs(fit.phi_J - PHI_J) < 3 * fit.phi_J_error


def test_error_is_that_of_noise():
    rng = np.random.default_rng(1)
    phi = np.linspace(0.7, 0.9, 300)
    p = line(phi) + 3e-5 * rng.standard_normal((30, len(phi)))
    phi_J, error = np.array([fit_onset(phi, row)[:2] for row in p]).T
    assert phi_J.mean() == pytest.approx(PHI_J, abs=2e-5)
    assert 0.3 < np.sqrt(np.mean(((phi_J - PHI_J) / error) ** 2)) < 1.2


def test_ends_before_the_first_drop():
    phi = np.linspace(0.4, 0.9, 2000)
    p = line(phi)
    p[phi > 0.852] -= 0.001
    p[phi > 0.87] -= 0.001
    fit = fit_onset(phi, p)
    assert fit.phi_J == pytest.approx(PHI_J, abs=1e-13)
    assert 0.8515 < phi[fit.last] <= 0.852


def test_drops_that_a_finite_rate_smears_out():
    phi = np.linspace(0.8, 0.9, 1000)
    p = rounded(phi, 3e-4)
    for drop in (0.86, 0.88):
        p -= 0.0003 * (1 + np.tanh((phi - drop) / 5e-4))
    fit = fit_onset(phi, p)
    assert fit.phi_J == pytest.approx(PHI_J, abs=1e-4)
    assert phi[fit.last] < 0.861
    assert abs(fit.phi_J - PHI_J) < 3 * fit.phi_J_error


def test_clusters_that_come_apart_again_are_no_onset():
    phi = np.linspace(0.8, 0.9, 1000)
    p = line(phi) + 1e-9
    for start in (0.82, 0.83, 0.838):
        p += np.where((phi > start) & (phi < start + 0.003), line(phi, start), 0)
    fit = fit_onset(phi, p)
    assert fit.phi_J == pytest.approx(PHI_J, abs=1e-7)


def test_shallow_bumps_of_the_foot_are_no_onset():
    phi = np.linspace(0.8, 0.9, 1000)
    p = np.maximum(line(phi), np.minimum(line(phi, 0.825, 0.12), 1e-3)) + 1e-6
    assert fit_onset(phi, p).phi_J == pytest.approx(PHI_J, abs=2e-5)


def test_curve_that_stiffens_far_above():
    phi = np.linspace(0.8, 1.0, 1000)
    fit = fit_onset(phi, rounded(phi, 1e-3) * (1 + 2 * line(phi, slope=1)))
    assert abs(fit.phi_J - PHI_J) < min(1e-3, 3 * fit.phi_J_error)


@pytest.mark.parametrize("slope", [0.22, 0.25, 0.28, 0.35])
def test_error_holds_the_choice_of_the_window(slope):
    phi, bend = np.linspace(0.8, 0.9, 800), 0.86
    p = line(np.minimum(phi, bend)) + slope * np.maximum(phi - bend, 0)
    fit = fit_onset(phi, p)
    assert fit.phi_J == pytest.approx(PHI_J, abs=1e-12)
    # Both stretches are straight, so neither line has an error of its own.
    other = bend - SLOPE / slope * (bend - PHI_J)
    assert 0.3 < fit.phi_J_error / abs(other - PHI_J) < 1


def test_error_holds_windows_after_a_plastic_drop():
    phi = np.linspace(0.8, 0.9, 1000)
    p = line(phi)
    p[phi > 0.85] -= SLOPE * 0.004  # the line after it leads to PHI_J + 0.004
    fit = fit_onset(phi, p)
    assert fit.phi_J == pytest.approx(PHI_J, abs=1e-12)
    assert 0.002 < fit.phi_J_error < 0.004


@pytest.mark.parametrize("seed", [8, 13, 15, 16])  # of 40, those that differ most
def test_rows_that_are_left_out_move_it_within_its_errors(seed):
    rng, phi = np.random.default_rng(seed), np.linspace(0.8, 0.9, 800)
    p = rounded(phi, 2e-3)
    for k in range(4):
        at = 0.845 + 0.012 * k + rng.uniform(0, 0.006)
        size, width = rng.uniform(3e-5, 3e-4), rng.uniform(1e-3, 3e-3)
        p = p - size * (1 + np.tanh((phi - at) / width))
    parts = [(k, start) for k in (1, 2, 4) for start in range(k)]
    found = np.array([fit_onset(phi[s::k], p[s::k])[:2] for k, s in parts])
    apart = found[:, None, 0] - found[None, :, 0]
    errors = np.hypot(found[:, None, 1], found[None, :, 1])
    assert np.sqrt(np.mean((apart / errors) ** 2)) < 1.2


def test_few_rows_after_a_long_wait():
    phi = np.linspace(0.4, 0.86, 200)  # as many rows as the decks take: 8 above the onset
    assert fit_onset(phi, line(phi)).phi_J == pytest.approx(PHI_J, abs=1e-13)


def test_rows_with_large_errors_weigh_little():
    rng = np.random.default_rng(2)
    phi = np.linspace(0.84, 0.9, 200)
    error = np.where(phi > 0.87, 1e-4, 1e-6)
    p = line(phi) + error * rng.standard_normal(200)
    weighed = fit_onset(phi, p, error)
    assert weighed.phi_J == pytest.approx(PHI_J, abs=3e-6)
    assert fit_onset(phi, p, 1e3 * error) == pytest.approx(weighed, rel=1e-12)


def test_starts_above_the_onset():
    phi = np.linspace(0.845, 0.9, 100)
    assert fit_onset(phi, line(phi)).phi_J == pytest.approx(PHI_J, abs=1e-13)


@pytest.mark.parametrize(
    "p",
    [
        lambda phi: 0 * phi,
        lambda phi: np.abs(np.sin(1e4 * phi)) * 1e-9,
        lambda phi: 1e-9 * np.random.default_rng(3).standard_normal(len(phi)),
        lambda phi: line(phi) * (phi < 0.88),
        lambda phi: -line(phi),
    ],
    ids=["zero", "flicker", "noise", "comes apart", "negative"],
)
def test_no_onset(p):
    phi = np.linspace(0.4, 0.9, 500)
    with pytest.raises(ValueError, match=r"p has no onset of jamming up to phi = 0\.9, expected"):
        fit_onset(phi, p(phi))


def test_nothing_linear_in_the_foot():
    phi = np.linspace(0.4, 0.8, 500)
    with pytest.raises(ValueError, match=r"nowhere in a line that leads to zero.*compress further"):
        fit_onset(phi, 1e-6 * np.exp(phi / 0.03))


def test_refuses():
    phi = np.linspace(0.8, 0.9, 50)
    with pytest.raises(ValueError, match=r"shapes \(50,\) and \(49,\), expected \(T,\)"):
        fit_onset(phi, line(phi)[1:])
    with pytest.raises(ValueError, match=r"expected \(T,\) with T >= 5"):
        fit_onset(phi[:4], line(phi)[:4])
    for wrong in (phi[::-1], np.where(phi > 0.85, np.nan, phi)):
        with pytest.raises(ValueError, match="expected ascending phi, finite p"):
            fit_onset(wrong, line(phi))
    with pytest.raises(ValueError, match="expected ascending phi, finite p"):
        fit_onset(phi, line(phi), 0 * phi)
