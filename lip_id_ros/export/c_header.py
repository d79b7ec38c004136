"""
An identified arm as one C header with constants, for controllers.

`dynamics.h.in` has the recursive Newton-Euler algorithm; links and friction are put in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import resources
import re
from string import Template
import textwrap

import numpy as np

from lip_id_ros.errors import printable
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.text import COLUMNS, header_lines
from lip_id_ros.friction.drives import Drive
from lip_id_ros.friction.primitives import (
    ACCELERATION,
    ANYWHERE,
    Column,
    COSINE,
    LEVER,
    LOAD,
    ONE,
    POSITION,
    Primitive,
    REVERSAL,
    SIGN,
    SQUARE,
    STEP,
    STEP_AT,
    VELOCITY,
)
from lip_id_ros.rigid_body.couplings import couplings_of

TEMPLATE = 'dynamics.h.in'
REMARKS = (
    'The header has the links, rotors and every term of friction of the model, without standard '
    'deviations. A model with a Gaussian process is not written as C.',
    'Friction that remembers the past of a joint (Dahl) is left out: it has that of the other '
    'terms.',
    'It checks and limits nothing: references, torques and their rates are up to the controller.',
)


def to_c_header(arm: ArmDescription) -> str:
    """Return an arm as a C header, in which all names begin with that of the arm."""
    template = Template((resources.files(__package__) / TEMPLATE).read_text(encoding='utf-8'))
    n = arm.n_joints
    return template.substitute(
        n=n,
        prefix=arm.name,
        PREFIX=arm.name.upper(),
        comment=_comment(arm),
        joints='\n'.join(
            f' *   {i}: {name}' for i, name in enumerate(_safe(map(printable, arm.joint_names)))
        ),
        links=',\n'.join(_link(arm, i) for i in range(n)),
        up=_list(-arm.chain.gravity),
        reference=textwrap.fill(
            _list(arm.potential_reference),
            COLUMNS,
            initial_indent=INDENT,
            subsequent_indent=INDENT,
        ),
        potential=_number(arm.reference_potential()),
        friction='\n'.join(_friction(arm)),
        **_coupling(arm),
    )


INDENT = '   '
_MOTIONS = ('q', 'dq', 'ddq')

COUPLING = """\
/*
 * Reported positions are coupled. A joint moves by its own and a share of another one:
{said}
 */
static inline void {prefix}_joints_of(const double *x, double *out) {{
  int i;
  for (i = 0; i < {n}; i++) out[i] = x[i];
{added}
}}

"""


def identifier(name: str) -> str:
    """Return a name that C and URDF understand: letters, digits and underscores."""
    plain = re.sub(r'\W', '_', name, flags=re.ASCII).strip('_') or 'arm'
    return f'arm_{plain}' if plain[0].isdigit() else plain


def _comment(arm: ArmDescription) -> str:
    return '\n'.join(f' * {line}'.rstrip() for line in _safe(header_lines(arm, REMARKS)))


def _safe(lines: Iterable[str]) -> list[str]:
    # what would end a comment, or begin one, and what C takes for a backslash
    return [re.sub(r'\*(?=/)|/(?=\*)|\?(?=\?)', r'\g<0> ', line) for line in lines]


def _link(arm: ArmDescription, i: int) -> str:
    chain, links = arm.chain, arm.links[i]
    fields = (
        f'{{{_list(chain.rotations[i].ravel())}}}',
        f'{{{_list(chain.translations[i])}}}',
        str(int(chain.prismatic[i])),
        _number(links[0]),
        f'{{{_list(links[1:4])}}}',
        f'{{{_list(links[4:10])}}}',
        _number(links[10]),
    )
    return '    {' + ',\n     '.join(fields) + '}'


def _coupling(arm: ArmDescription) -> dict[str, str]:
    """Return what differs where reported positions are coupled: rotors turn with these."""
    couplings = couplings_of(arm.chain.couplings)
    if not couplings:
        none = dict.fromkeys(('coupling', 'declared', 'motions', 'shares'), '')
        return {**none, **{f'{x[:-1]}p': x for x in _MOTIONS}}
    names = [_safe([printable(name)])[0] for name in arm.joint_names]
    said = '\n'.join(f' *   {names[j]} {ratio:+g} {names[k]}' for j, k, ratio in couplings)
    added = '\n'.join(f'  out[{j}] += {_number(ratio)} * x[{k}];' for j, k, ratio in couplings)
    shares = ''.join(
        f'    if (i == {j}) tau[{k}] += {_number(ratio)} * own;\n' for j, k, ratio in couplings
    )
    return {
        'coupling': COUPLING.format(said=said, prefix=arm.name, n=arm.n_joints, added=added),
        'motions': ''.join(f'  {arm.name}_joints_of({x}, {x[:-1]}p);\n' for x in _MOTIONS),
        'declared': f'  double p[{arm.n_joints}], dp[{arm.n_joints}], ddp[{arm.n_joints}];\n',
        'shares': shares,
        **{f'{x[:-1]}p': f'{x[:-1]}p' for x in _MOTIONS},
    }


def _friction(arm: ArmDescription) -> list[str]:
    by_drive: dict[Drive, list[tuple[str, float, Column]]] = {}
    for part, coefficients in arm.friction_terms():
        columns = zip(coefficients, part.term.columns, strict=True)
        features = [(part.term.name, float(factor), column) for factor, column in columns]
        by_drive.setdefault(part.drive, []).extend(features)
    lines = []
    for drive, features in by_drive.items():
        lines += _drive(drive, features, arm)
    return lines


def _drive(
    drive: Drive, features: list[tuple[str, float, Column]], arm: ArmDescription
) -> list[str]:
    used = [primitive for _, _, column in features for _, primitive in column]
    widths = sorted({p.width for p in used if p.shape in (SIGN, REVERSAL)})
    signs = {width: f's{k}' for k, width in enumerate(widths)}
    names = _safe([' with '.join(arm.joint_names[i] for i in drive.joints)])[0]
    rise_time = arm.friction.basis.rise_time
    lines = [f'  {{ /* {names} */']
    if any(p.shape not in (ONE, LOAD, ACCELERATION) or p.side for p in used):
        lines.append(f'    const double v = {_combination("dq", drive)};')
    if any(p.shape in (REVERSAL, ACCELERATION) for p in used) or (signs and rise_time):
        lines.append(f'    const double a = {_combination("ddq", drive)};')
    if any(p.position != ANYWHERE for p in used):
        lines.append(f'    const double p = {_combination("q", drive)};')
    if any(p.loaded or p.shape == LOAD for p in used):
        lines.append(f'    const double l = load[{drive.joints[0]}];')
    for width, name in signs.items():
        smooth = _number(width)
        if rise_time:
            smooth = f'hypot({smooth}, {_number(rise_time)} * a)'
        lines.append(f'    const double {name} = tanh(v / {smooth});')
    lines.append('    double f = 0.0;')
    for name, factor, column in features:
        if not column:
            lines.append(f'    /* {name} needs the past of the joint: it is left out */')
            continue
        lines.append(f'    f += {_number(factor)} * {_column(column, signs)}; /* {name} */')
    for joint, share in drive.efforts:
        torque = 'f' if share == 1.0 else f'{_number(share)} * f'
        lines.append(f'    friction[{joint}] += {torque};')
    return [*lines, '  }']


def _combination(name: str, drive: Drive) -> str:
    pairs = zip(drive.joints, drive.ratios, strict=True)
    return ' + '.join(
        f'{name}[{joint}]' if ratio == 1.0 else f'{_number(ratio)} * {name}[{joint}]'
        for joint, ratio in pairs
        if ratio != 0.0
    )


def _column(column: Column, signs: Mapping[float, str]) -> str:
    parts = []
    for factor, primitive in column:
        text = _primitive(primitive, signs)
        parts.append(text if factor == 1.0 else f'{_number(factor)} * {text}')
    return parts[0] if len(parts) == 1 else f'({" + ".join(parts)})'


def _primitive(primitive: Primitive, signs: Mapping[float, str]) -> str:
    shapes = {ONE: '1.0', VELOCITY: 'v', SQUARE: 'v * fabs(v)', LOAD: 'l', ACCELERATION: 'a'}
    if primitive.shape == STEP:
        text = f'tanh((v - {_number(primitive.centre)}) / {_number(primitive.width)})'
    else:
        text = shapes.get(primitive.shape) or signs[primitive.width]
    if primitive.shape == REVERSAL:
        text = f'(1.0 - {text} * {text}) * tanh(a / {_number(primitive.acceleration)})'
    if primitive.side:
        text = f'(v {">" if primitive.side > 0 else "<"} 0.0 ? {text} : 0.0)'
    if primitive.position == POSITION:
        text += ' * p'
    elif primitive.position == STEP_AT:
        text += f' * tanh({_number(primitive.harmonic)} * (p - {_number(primitive.centre)}))'
    elif primitive.position == LEVER:
        at = f'(p - {_number(primitive.centre)})'
        text += f' * sin{at} / sqrt(1.0 - {_number(primitive.harmonic)} * cos{at})'
    elif primitive.position != ANYWHERE:
        function = 'cos' if primitive.position == COSINE else 'sin'
        at = f'(p - {_number(primitive.centre)})' if primitive.centre else 'p'
        text += f' * {function}({_number(primitive.harmonic)} * {at})'
    return f'fabs(l) * {text}' if primitive.loaded else text


def _list(values: Iterable[float]) -> str:
    return ', '.join(repr(float(value)) for value in np.asarray(values, dtype=np.float64))


def _number(value: float) -> str:
    """Return a number that C reads back as the same double."""
    text = repr(float(value))
    return f'({text})' if value < 0.0 else text
