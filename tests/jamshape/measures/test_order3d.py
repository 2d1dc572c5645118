import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jamshape.measures.order3d import (
    cubatic_order,
    local_cubatic_order,
    local_nematic_order,
    nematic_order,
)
from jamshape.packing import body_axes


def random_axes(n, seed=1):
    return body_axes(np.random.default_rng(seed).normal(size=(n, 4)))


def random_pairs(n, m, seed=2):
    i, j = np.triu_indices(n, 1)
    chosen = np.random.default_rng(seed).choice(len(i), m, replace=False)
    return np.column_stack([i, j])[chosen]


def cubic_group():
    signed = [np.eye(3)[list(order)] for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))]
    signed += [matrix[[1, 0, 2]] for matrix in signed]
    return [np.diag(1 - 2 * np.array(flip)) @ m for m in signed for flip in np.ndindex(2, 2, 2)]


def legendre(c):
    return np.polynomial.legendre.legval(c, [0, 0, 0, 0, 1])


def nearest_mean(t, axes):
    """P_4 between t and the nearest axis of each particle, by loops."""
    cosines = [max(abs(float(np.dot(t, axis))) for axis in particle) for particle in axes]
    return float(np.mean([legendre(c) for c in cosines]))


def test_axes_are_the_columns_of_the_rotation():
    q = np.random.default_rng(0).normal(size=(20, 4))
    matrices = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(body_axes(q), matrices.transpose(0, 2, 1), atol=1e-15)
    np.testing.assert_allclose(body_axes([1, 0, 0, 0]), np.eye(3))
    assert body_axes(q.reshape(4, 5, 4)).shape == (4, 5, 3, 3)


def test_alignment_is_order_1():
    axes = np.tile(random_axes(1), (50, 1, 1))
    S, direction = nematic_order(axes[:, 2])
    assert pytest.approx(1, abs=1e-14) == S
    assert abs(direction @ axes[0, 2]) == pytest.approx(1)
    C, direction = cubatic_order(axes)
    assert pytest.approx(1, abs=1e-14) == C
    assert np.abs(axes[0] @ direction).max() == pytest.approx(1)
    pairs = random_pairs(50, 200)
    touched = np.unique(pairs)
    np.testing.assert_allclose(local_nematic_order(axes[:, 0], pairs)[touched], 1, atol=1e-14)
    np.testing.assert_allclose(local_cubatic_order(axes, pairs)[touched], 1, atol=1e-14)


def test_random_orientations_of_400_have_the_papers_disorder(measured):
    found = np.array(
        [
            [nematic_order(axes[:, 0]).magnitude, cubatic_order(axes).magnitude]
            for axes in (random_axes(400, seed) for seed in range(12))
        ]
    )
    S, C = found.mean(axis=0)
    measured(S_2=S, C_4=C, S_2_spread=found[:, 0].std(), C_4_spread=found[:, 1].std())
    assert pytest.approx(0.044, abs=0.008) == S
    assert pytest.approx(0.064, abs=0.008) == C
    assert (found < 0.12).all()


def test_axis_that_maximises_the_polynomial_would_not_be_the_papers():
    u = random_axes(400)
    cosines = np.einsum("tj,nkj->tnk", u.reshape(-1, 3), u)
    literal = legendre(cosines).max(axis=-1).mean(axis=-1).max()
    assert literal == pytest.approx(0.29, abs=0.03)


def test_order_is_that_of_loops():
    axes, pairs = random_axes(12), random_pairs(12, 25)
    C, direction = cubatic_order(axes)
    everything = [nearest_mean(t, axes) for t in axes.reshape(-1, 3)]
    assert pytest.approx(max(everything), rel=1e-13) == C
    assert nearest_mean(direction, axes) == pytest.approx(C, rel=1e-13)
    s = axes[:, 1]
    tensor = 1.5 * np.mean([np.outer(v, v) for v in s], axis=0) - np.eye(3) / 2
    S, direction = nematic_order(s)
    assert pytest.approx(np.linalg.eigvalsh(tensor).max(), rel=1e-13) == S
    assert direction @ tensor @ direction == pytest.approx(S, rel=1e-13)
    local_S, local_C = local_nematic_order(s, pairs), local_cubatic_order(axes, pairs)
    for i in range(12):
        near = [j for pair in pairs.tolist() if i in pair for j in pair if j != i]
        assert near
        assert local_S[i] == pytest.approx(nematic_order(s[near]).magnitude, rel=1e-12)
        best = max(nearest_mean(t, axes[near]) for t in axes[i])
        assert local_C[i] == pytest.approx(best, rel=1e-12, abs=1e-14)


def test_blocks_do_not_matter(monkeypatch):
    axes = random_axes(60)
    whole = cubatic_order(axes)
    monkeypatch.setattr("jamshape.measures.order3d._BLOCK", 1000)
    parts = cubatic_order(axes)
    assert parts.magnitude == pytest.approx(whole.magnitude, rel=1e-14)
    np.testing.assert_array_equal(parts.direction, whole.direction)


def measures(axes, pairs):
    return (
        nematic_order(axes[:, 0]).magnitude,
        cubatic_order(axes).magnitude,
        local_nematic_order(axes[:, 0], pairs),
        local_cubatic_order(axes, pairs),
    )


def test_rotation_of_everything_changes_nothing():
    axes, pairs = random_axes(40), random_pairs(40, 90)
    turned = axes @ random_axes(1, seed=3)[0]
    for before, after in zip(measures(axes, pairs), measures(turned, pairs), strict=True):
        np.testing.assert_allclose(after, before, atol=1e-13)


def test_relabelling_changes_nothing():
    axes, pairs = random_axes(40), random_pairs(40, 90)
    order = np.random.default_rng(4).permutation(40)
    rank = np.argsort(order)
    relabelled = rank[pairs][::-1, ::-1]
    S, C, local_S, local_C = measures(axes, pairs)
    S_after, C_after, local_S_after, local_C_after = measures(axes[order], relabelled)
    assert (S_after, C_after) == pytest.approx((S, C), abs=1e-14)
    np.testing.assert_allclose(local_S_after, local_S[order], atol=1e-13)
    np.testing.assert_allclose(local_C_after, local_C[order], atol=1e-13)


def test_cubatic_order_does_not_tell_the_axes_of_a_particle_apart():
    axes, pairs = random_axes(48), random_pairs(48, 100)
    group = cubic_group()
    assert len({matrix.tobytes() for matrix in group}) == 48
    turned = np.array([m @ u for m, u in zip(group, axes, strict=True)])
    assert cubatic_order(turned).magnitude == pytest.approx(cubatic_order(axes).magnitude)
    np.testing.assert_allclose(
        local_cubatic_order(turned, pairs), local_cubatic_order(axes, pairs), atol=1e-14
    )


def test_nematic_order_does_not_tell_head_from_tail():
    s, pairs = random_axes(40)[:, 0], random_pairs(40, 90)
    flipped = s * np.random.default_rng(5).choice([-1, 1], (40, 1))
    assert nematic_order(flipped).magnitude == pytest.approx(nematic_order(s).magnitude)
    np.testing.assert_allclose(
        local_nematic_order(flipped, pairs), local_nematic_order(s, pairs), atol=1e-14
    )


def test_order_of_cubes_with_disorder_of_directors():
    # Cubes that are stacked, each with another of its axes up: cubatic order but no nematic.
    directors = np.eye(3)[np.arange(300) % 3]
    axes = np.array([np.roll(np.eye(3), k % 3, axis=0) for k in range(300)])
    assert cubatic_order(axes).magnitude == pytest.approx(1)
    assert nematic_order(directors).magnitude == pytest.approx(0, abs=1e-14)


def test_directors_in_a_plane():
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    s = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert nematic_order(s).magnitude == pytest.approx(0.25)


def test_particles_without_contacts_have_no_local_order():
    axes = random_axes(4)
    for found in (
        local_nematic_order(axes[:, 0], np.array([[2, 0]])),
        local_cubatic_order(axes, np.array([[2, 0]])),
    ):
        assert np.isnan(found).tolist() == [False, True, False, True]
    assert local_nematic_order(axes[:, 0], np.array([[2, 0]]))[0] == pytest.approx(1)
    assert np.isnan(local_cubatic_order(axes, np.empty((0, 2), int))).all()


def test_what_is_no_orientation_is_refused():
    axes = random_axes(3)
    with pytest.raises(ValueError, match="hold zero, NaN"):
        body_axes([[1, 0, 0, 0], [0, 0, 0, 0]])
    with pytest.raises(ValueError, match=r"shape \(3,\), expected \(..., 4\)"):
        body_axes([1, 0, 0])
    for wrong in (axes, np.empty((0, 3)), axes[0, 0]):
        with pytest.raises(ValueError, match=r"expected \(N, 3\) with N > 0"):
            nematic_order(wrong)
    for wrong in (axes[:, 0], np.empty((0, 3, 3))):
        with pytest.raises(ValueError, match=r"expected \(N, 3, 3\) with N > 0"):
            cubatic_order(wrong)
    for wrong in (1.1 * axes, np.nan * axes):
        with pytest.raises(ValueError, match="expected unit vectors"):
            cubatic_order(wrong)


@pytest.mark.parametrize("pairs", [[[0, 3]], [[-1, 0]], [[0, 1, 2]], [[0.0, 1.0]], [0, 1]])
def test_what_are_no_pairs_is_refused(pairs):
    axes = random_axes(3)
    for of, vectors in ((local_nematic_order, axes[:, 0]), (local_cubatic_order, axes)):
        with pytest.raises(ValueError, match="pairs"):
            of(vectors, np.array(pairs))
