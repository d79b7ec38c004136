"""Methods by name; what a method needs is imported only where it is asked for."""

from __future__ import annotations

from collections.abc import Callable
import os

from lip_id_ros.baselines.interface import Method
from lip_id_ros.errors import ConfigError, LipIdError

Urdf = str | os.PathLike[str]

OURS = ('lip', 'recursive', 'articulated')


def method(name: str, urdf: Urdf | None = None) -> Method:
    """
    Return a method by its name.

    Parameters
    ----------
    name : str
        One of `MODELS`.
    urdf : path, optional
        Robot description, for those that need one.

    Raises
    ------
    ConfigError
        If there is no such method, or it needs a URDF and none is given.
    DataError
        If the URDF cannot be understood.
    LipIdError
        If a package is missing.
    OSError
        If the URDF cannot be opened.

    """
    if name not in MODELS:
        raise ConfigError(f'{name!r} is not a model; there are {", ".join(MODELS)}.')
    try:
        if not needs_urdf(name):
            return _BLACK_BOX[name]()
        if urdf is None:
            raise ConfigError(
                f'the model {name!r} needs the kinematics of the robot; name its URDF file.'
            )
        return _WITH_KINEMATICS[name](urdf)
    except ImportError as error:
        raise LipIdError(
            f'the model {name!r} needs a package that is missing ({error}); '
            "install it with `pip install 'lip_id_ros[torch,sim]'`."
        ) from error


def needs_urdf(name: str) -> bool:
    """Whether a method needs the kinematics of the robot."""
    return name in _WITH_KINEMATICS


def _ours(kernel: str) -> Method:
    from lip_id_ros.baselines.ours import Ours

    return Ours(kernel)


def _se() -> Method:
    from lip_id_ros.baselines.single_output import SingleOutput
    from lip_id_ros.baselines.terms import SquaredExponential

    return SingleOutput((SquaredExponential,))


def _gip() -> Method:
    from lip_id_ros.baselines.single_output import SingleOutput
    from lip_id_ros.baselines.terms import Friction, GeometricPolynomial

    return SingleOutput((GeometricPolynomial,), Friction)


def _lse() -> Method:
    from lip_id_ros.baselines.lse import Lse

    return Lse()


def _delan() -> Method:
    from lip_id_ros.baselines.delan import Delan

    return Delan()


def _rigid_body(urdf: Urdf) -> Method:
    from lip_id_ros.baselines.rigid_body import RigidBody

    return RigidBody(urdf)


def _semiparametric(urdf: Urdf) -> Method:
    from lip_id_ros.baselines.semiparametric import Semiparametric

    return Semiparametric(urdf)


_BLACK_BOX: dict[str, Callable[[], Method]] = {
    'se': _se,
    'gip': _gip,
    'lse': _lse,
    'delan': _delan,
    **{kernel: lambda kernel=kernel: _ours(kernel) for kernel in OURS},  # type: ignore[misc]
}
_WITH_KINEMATICS: dict[str, Callable[[Urdf], Method]] = {
    'rigid_body': _rigid_body,
    'semiparametric': _semiparametric,
}
MEANINGS = {
    'se': 'a Gaussian process per joint, squared exponential',
    'gip': 'a Gaussian process per joint, geometrically inspired polynomial kernel',
    'lse': 'a Gaussian process on the Lagrangian, squared exponential',
    'delan': 'a deep Lagrangian network',
    'lip': "Gaussian processes on the energies, the paper's polynomial kernel",
    'recursive': 'Gaussian processes on the energies, a kernel composed from base to tip',
    'articulated': 'rigid links, the places of whose joints are found in the data, and Gaussian '
    'processes where they leave something over; the default of this package',
    'rigid_body': 'least squares on rigid-body dynamics, kinematics known from a URDF',
    'semiparametric': 'a Gaussian process per joint, rigid-body features and squared exponential',
}
"""What each is, in words for those who compare them."""
MODELS = (*_BLACK_BOX, *_WITH_KINEMATICS)
"""Names of all methods."""
