"""Rotations against scipy, in both libraries and both precisions, and where they are delicate."""

import ast
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from spark import euler, sixd
from spark import rotation as r
from spark.euler import euler_from_quat, quat_from_euler
from spark.sixd import matrix_from_sixd, quat_from_sixd, sixd_from_quat

ORDERS = ["".join(p) for p in permutations("xyz")]
KINDS = [
    pytest.param(np.asarray, np.float64, 1e-12, id="numpy64"),
    pytest.param(np.asarray, np.float32, 2e-6, id="numpy32"),
    pytest.param(torch.as_tensor, np.float64, 1e-12, id="torch64"),
    pytest.param(torch.as_tensor, np.float32, 2e-6, id="torch32"),
]
CASES = Rotation.random(200, random_state=1) * Rotation.identity()


def wxyz(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def as_matrix(q: Any) -> np.ndarray:
    return Rotation.from_quat(np.roll(np.asarray(q, dtype=np.float64), -1, axis=-1)).as_matrix()


@pytest.mark.parametrize(("make", "dtype", "eps"), KINDS)
def test_conversions_agree_with_scipy(make: Any, dtype: Any, eps: float) -> None:
    q = make(wxyz(CASES).astype(dtype))
    other = make(wxyz(CASES[::-1]).astype(dtype))
    v = make(np.random.default_rng(0).normal(size=(200, 3)).astype(dtype))
    close = {"atol": 20 * eps, "rtol": 0}
    np.testing.assert_allclose(np.asarray(r.matrix_from_quat(q)), CASES.as_matrix(), **close)
    np.testing.assert_allclose(np.asarray(r.rotvec_from_quat(q)), CASES.as_rotvec(), **close)
    np.testing.assert_allclose(np.asarray(r.quat_rotate(q, v)), CASES.apply(np.asarray(v)), **close)
    for result, expected in (
        (r.quat_from_rotvec(make(CASES.as_rotvec().astype(dtype))), CASES),
        (r.quat_from_matrix(make(CASES.as_matrix().astype(dtype))), CASES),
        (quat_from_sixd(sixd_from_quat(q)), CASES),
        (r.quat_mul(q, other), CASES * CASES[::-1]),
        (r.quat_conj(q), CASES.inv()),
        (r.quat_relative(q, other), CASES.inv() * CASES[::-1]),
    ):
        assert result.dtype == q.dtype
        np.testing.assert_allclose(as_matrix(result), expected.as_matrix(), **close)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("make", "dtype", "eps"), KINDS)
def test_euler_angles_are_intrinsic_as_scipys_capitals(
    make: Any, dtype: Any, eps: float, order: str
) -> None:
    angles = CASES.as_euler(order.upper())
    q = quat_from_euler(make(angles.astype(dtype)), order)
    np.testing.assert_allclose(as_matrix(q), CASES.as_matrix(), atol=20 * eps)
    back = np.asarray(euler_from_quat(q, order), dtype=np.float64)
    away = np.abs(np.abs(angles[:, 1]) - np.pi / 2) > 0.05
    np.testing.assert_allclose(back[away], angles[away], atol=400 * eps)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("middle", [np.pi / 2, -np.pi / 2])
@pytest.mark.parametrize(("dtype", "atol"), [(np.float64, 1e-6), (np.float32, 3e-3)])
def test_euler_angles_at_the_singularity_give_the_same_rotation(
    order: str, middle: float, dtype: Any, atol: float
) -> None:
    """To the root of the precision: that much a middle angle near 90 degrees leaves undefined."""
    rng = np.random.default_rng(0)
    angles = rng.uniform(-3, 3, (50, 3)).astype(dtype)
    angles[:, 1] = middle + np.repeat([0, 1e-9, -1e-6, 1e-3, -1e-3], 10)
    q = quat_from_euler(angles, order)
    back = euler_from_quat(q, order)
    assert dtype == np.float32 or np.all(back[:10, 2] == 0)
    assert r.quat_angle(quat_from_euler(back, order), q).max() < atol


@pytest.mark.parametrize("order", ["xy", "xxy", "abc", ""])
def test_euler_orders_that_are_none_are_refused(order: str) -> None:
    with pytest.raises(ValueError, match="permutation"):
        quat_from_euler(np.zeros(3), order)


HALF_TURNS = np.concatenate([np.eye(4), -np.eye(4)])
ALL = {
    "quat_mul": lambda q, p, v: r.quat_mul(q, p),
    "quat_conj": lambda q, p, v: r.quat_conj(q),
    "quat_relative": lambda q, p, v: r.quat_relative(q, p),
    "quat_rotate": lambda q, p, v: r.quat_rotate(q, v),
    "quat_normalize": lambda q, p, v: r.quat_normalize(q),
    "quat_identity": lambda q, p, v: r.quat_identity(v),
    "quat_continuous": lambda q, p, v: r.quat_continuous(q),
    "quat_angle": lambda q, p, v: r.quat_angle(q, p),
    "quat_from_rotvec": lambda q, p, v: r.quat_from_rotvec(v),
    "rotvec_from_quat": lambda q, p, v: r.rotvec_from_quat(q),
    "quat_slerp": lambda q, p, v: r.quat_slerp(q, p, v[..., 0]),
    "quat_between": lambda q, p, v: r.quat_between(v, q[..., 1:]),
    "quat_swing_twist": lambda q, p, v: r.quat_swing_twist(q, v)[1],
    "yaw_from_quat": lambda q, p, v: r.yaw_from_quat(q),
    "quat_from_yaw": lambda q, p, v: r.quat_from_yaw(v[..., 0]),
    "quat_about": lambda q, p, v: r.quat_about("y", v[..., 0]),
    "quat_from_euler": lambda q, p, v: quat_from_euler(v, "yxz"),
    "euler_from_quat": lambda q, p, v: euler_from_quat(q, "zxy"),
    "matrix_from_quat": lambda q, p, v: r.matrix_from_quat(q),
    "quat_from_matrix": lambda q, p, v: r.quat_from_matrix(r.matrix_from_quat(q)),
    "matrix_from_sixd": lambda q, p, v: matrix_from_sixd(sixd_from_quat(q)),
    "sixd_from_quat": lambda q, p, v: sixd_from_quat(q),
    "quat_from_sixd": lambda q, p, v: quat_from_sixd(sixd_from_quat(q)),
}
"""Each function of two quaternions and a vector."""


def test_the_list_of_functions_is_whole() -> None:
    nodes = [
        node for m in (r, euler, sixd) for node in ast.parse(Path(m.__file__).read_text()).body
    ]
    names = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    assert {name for name in names if not name.startswith("_")} == set(ALL)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_torch_agrees_with_numpy_and_keeps_the_type(name: str, dtype: Any) -> None:
    q, p = wxyz(CASES).astype(dtype), wxyz(CASES[::-1]).astype(dtype)
    v = (CASES.as_rotvec() / np.pi).astype(dtype)
    ours = ALL[name](q, p, v)
    theirs = ALL[name](*map(torch.as_tensor, (q, p, v)))
    assert ours.dtype == dtype
    np.testing.assert_allclose(theirs.numpy(), ours, atol=200 * np.finfo(dtype).eps)


@pytest.mark.parametrize("name", ALL)
def test_any_leading_axes_will_do(name: str) -> None:
    q, p, v = wxyz(CASES), wxyz(CASES[::-1]), CASES.as_rotvec()
    flat = ALL[name](q, p, v)
    if name != "quat_continuous":  # its first axis is time
        one = ALL[name](q[7], p[7], v[7])
        np.testing.assert_allclose(one, flat[7], atol=1e-12)
        grid = ALL[name](q.reshape(10, 20, 4), p.reshape(10, 20, 4), v.reshape(10, 20, 3))
        np.testing.assert_allclose(grid.reshape(flat.shape), flat, atol=1e-12)


@pytest.mark.parametrize("name", sorted(set(ALL) - {"euler_from_quat", "yaw_from_quat"}))
@pytest.mark.parametrize("vector", [[0, 0, 0], [0, 0, 1.0], [0, 0, -1.0], [0, 0, 1e-20]])
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_values_and_gradients_are_finite_where_it_is_delicate(
    name: str, vector: list[float], dtype: torch.dtype
) -> None:
    """No turn, half turns about each axis, equal and opposite rotations, zero and tiny vectors."""
    first, second = (torch.as_tensor(x).to(dtype) for x in np.meshgrid(range(8), range(8)))
    q = torch.as_tensor(HALF_TURNS).to(dtype)[first.long().ravel()].requires_grad_()
    p = torch.as_tensor(HALF_TURNS).to(dtype)[second.long().ravel()].requires_grad_()
    v = torch.tensor([vector], dtype=dtype).repeat(len(q), 1).requires_grad_()
    out = ALL[name](q, p, v)
    assert torch.isfinite(out).all()
    if not out.requires_grad:
        assert name == "quat_identity"
        return
    (out * torch.arange(out.numel()).reshape(out.shape)).sum().backward()
    for x in (q, p, v):
        assert x.grad is None or torch.isfinite(x.grad).all()


def test_the_zero_quaternion_and_zero_vectors_are_no_turn() -> None:
    np.testing.assert_array_equal(r.quat_normalize(np.zeros(4)), [1, 0, 0, 0])
    np.testing.assert_array_equal(r.quat_from_rotvec(np.zeros(3)), [1, 0, 0, 0])


@pytest.mark.parametrize(("make", "dtype", "eps"), KINDS)
def test_half_turns_come_back_from_their_matrices(make: Any, dtype: Any, eps: float) -> None:
    """Each takes another of Shepperd's branches."""
    q = make(HALF_TURNS.astype(dtype))
    back = r.quat_from_matrix(r.matrix_from_quat(q))
    np.testing.assert_allclose(np.abs(np.asarray((back * q).sum(-1))), 1, atol=eps)
    assert np.asarray(back)[:, 0].min() >= 0


def test_sixd_of_anything_gives_a_rotation() -> None:
    matrix = matrix_from_sixd(np.random.default_rng(0).normal(size=(100, 6)))
    np.testing.assert_allclose(matrix @ np.swapaxes(matrix, 1, 2), [np.eye(3)] * 100, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(matrix), 1, atol=1e-12)


@pytest.mark.parametrize("q", wxyz(CASES[:5]))
def test_the_shorter_way_round(q: np.ndarray) -> None:
    """Angle, logarithm and slerp take q and -q for the same rotation."""
    identity = np.array([1.0, 0, 0, 0])
    expected = np.linalg.norm(Rotation.from_quat(np.roll(q, -1)).as_rotvec())
    for sign in (1, -1):
        assert r.quat_angle(identity, sign * q) == pytest.approx(expected, abs=1e-12)
        assert np.linalg.norm(r.rotvec_from_quat(sign * q)) == pytest.approx(expected, abs=1e-12)
        half = r.quat_slerp(identity, sign * q, np.array(0.5))
        assert r.quat_angle(identity, half) == pytest.approx(expected / 2, abs=1e-12)


def test_slerp_agrees_with_scipy() -> None:
    ends = Rotation.random(2, random_state=3)
    fractions = np.linspace(0, 1, 11)
    expected = Slerp([0, 1], ends)(fractions)
    q0, q1 = (np.broadcast_to(q, (11, 4)) for q in wxyz(ends))
    np.testing.assert_allclose(
        as_matrix(r.quat_slerp(q0, q1, fractions)), expected.as_matrix(), atol=1e-12
    )
    np.testing.assert_allclose(
        as_matrix(r.quat_slerp(q0, -q1, fractions)), expected.as_matrix(), atol=1e-12
    )


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_values_and_gradients_at_zero_are_finite_and_right(dtype: torch.dtype) -> None:
    zero = torch.zeros(2, 3, dtype=dtype, requires_grad=True)
    out = r.rotvec_from_quat(r.quat_from_rotvec(zero))
    assert torch.equal(out, torch.zeros_like(out))
    out.sum().backward()
    torch.testing.assert_close(zero.grad, torch.ones_like(zero))


@pytest.mark.parametrize(("dtype", "rtol"), [(np.float64, 1e-14), (np.float32, 1e-6)])
def test_small_rotations_keep_all_their_digits(dtype: Any, rtol: float) -> None:
    """Of the vector parts, relative to their own size: the series must end where it may."""
    sizes = np.logspace(-12, 0, 200)
    rotvec = (sizes[:, None] * [0.6, -0.48, 0.64]).astype(dtype)
    vector = r.quat_from_rotvec(rotvec)[:, 1:]
    expected = np.sin(sizes / 2)[:, None] * [0.6, -0.48, 0.64]
    np.testing.assert_allclose(vector, expected, rtol=rtol)
    back = r.rotvec_from_quat(r.quat_from_rotvec(rotvec))
    np.testing.assert_allclose(back, rotvec, rtol=rtol)


@pytest.mark.parametrize("size", [1e-9, 9.99e-4, 1.001e-3, 0.5, 3.0])
def test_gradients_agree_with_differences(size: float) -> None:
    """On both sides of the point where the series takes over, too."""
    direction = torch.tensor([[0.6, -0.48, 0.64]], dtype=torch.float64)
    rotvec = (size * direction).requires_grad_()
    assert torch.autograd.gradcheck(r.quat_from_rotvec, (rotvec,), atol=1e-6)
    q = r.quat_from_rotvec(rotvec.detach()).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda q: r.rotvec_from_quat(r.quat_normalize(q)), (q,), atol=1e-6
    )


def test_sixd_gradient_survives_degenerate_columns() -> None:
    sixd = torch.zeros(1, 6, requires_grad=True)
    matrix_from_sixd(sixd).sum().backward()
    assert sixd.grad is not None
    assert torch.isfinite(sixd.grad).all()


unit = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: sum(x * x for x in v) > 1e-3)


@given(unit, unit)
def test_quat_between_takes_one_direction_to_the_other(a: tuple[float], b: tuple[float]) -> None:
    u, v = np.array(a), np.array(b)
    u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
    q = r.quat_between(u, v)
    np.testing.assert_allclose(r.quat_rotate(q, u), v, atol=1e-6)
    # The smallest such rotation: by the angle between them.
    angle = r.quat_angle(np.array([1.0, 0, 0, 0]), q)
    assert angle == pytest.approx(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v), abs=1e-5)


@pytest.mark.parametrize(("make", "dtype", "eps"), KINDS)
def test_quat_between_keeps_its_digits_near_opposites(make: Any, dtype: Any, eps: float) -> None:
    u = np.tile([0.48, 0.6, -0.64], (20, 1))
    side = np.cross(u, [1.0, 0, 0])
    angles = np.logspace(-18, 0, 20)[:, None]  # how far from opposite
    v = -u * np.cos(angles) + side / np.linalg.norm(side[0]) * np.sin(angles)
    u, v = u.astype(dtype), v.astype(dtype)
    q = r.quat_between(make(u), make(v))
    np.testing.assert_allclose(np.asarray(r.quat_rotate(q, make(u))), v, atol=30 * eps)


@pytest.mark.parametrize("axis", np.eye(3))
def test_quat_between_opposites_and_zero(axis: np.ndarray) -> None:
    np.testing.assert_allclose(r.quat_rotate(r.quat_between(axis, -axis), axis), -axis, atol=1e-9)
    np.testing.assert_array_equal(r.quat_between(axis, np.zeros(3)), [1, 0, 0, 0])


@given(unit, st.integers(0, 199))
def test_swing_twist_recomposes(a: tuple[float], case: int) -> None:
    axis = np.array(a) / np.linalg.norm(a)
    q = wxyz(CASES)[case]
    swing, twist = r.quat_swing_twist(q, axis)
    np.testing.assert_allclose(r.quat_mul(swing, twist), q, atol=1e-9)
    np.testing.assert_allclose(np.cross(twist[1:], axis), 0, atol=1e-9)
    assert swing[1:] @ axis == pytest.approx(0, abs=1e-9)


@given(st.floats(-3.1, 3.1))
def test_yaw(yaw: float) -> None:
    q = r.quat_from_yaw(np.array([yaw]))
    assert r.yaw_from_quat(q)[0] == pytest.approx(yaw, abs=1e-9)
    assert r.yaw_from_quat(-q)[0] == pytest.approx(yaw, abs=1e-9)


def test_continuous_signs() -> None:
    angles = np.linspace(0, 12, 100)
    q = r.quat_about("x", angles)
    broken = np.where(np.arange(100)[:, None] % 3 == 0, -q, q)
    mended = r.quat_continuous(broken)
    assert (np.sum(mended[1:] * mended[:-1], axis=-1) > 0).all()
    assert r.quat_angle(mended, q).max() < 1e-7


def test_a_wrong_shape_is_refused_under_test() -> None:
    """The shapes in the signatures are checked here; if they were not, this would pass silently."""
    with pytest.raises(Exception, match=r"[Tt]ype"):
        r.quat_mul(np.zeros((2, 3)), np.zeros((2, 4)))
