"""The parameters of one machine among several whose numbers stand side by side, for numba.

The functions of the core read `p.name`. With a `Lane` for p that is the machine's own entry of
the field, (LANES,) or (n, LANES), of a record that holds all of them: neighbours in memory, as
vector instructions want them. A field that the record does not have belongs to an effect and
reads as 0, which is known while compiling, so that nothing is left of the effect.
"""

from typing import Any

from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model

from emir_plant.jit import compiled

NUMBER = types.float64
NUMBERS = types.Array(NUMBER, 1, "A")
BYTES = 8  # of a number


class Lane(types.Type):
    """The type of the parameters of machine `index` in a record of this type."""

    def __init__(self, record: Any) -> None:
        self.record = record
        super().__init__(f"Lane({record})")


@register_model(Lane)
class _Model(models.StructModel):
    def __init__(self, manager: Any, lane: Lane) -> None:
        members = [("record", types.voidptr), ("index", types.intp)]
        super().__init__(manager, lane, members)


@intrinsic
def _lane(_context: Any, record: Any, _index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = cgutils.create_struct_proxy(signature.return_type)(context, builder)
        made.record = builder.bitcast(arguments[0], cgutils.voidptr_t)
        made.index = arguments[1]
        return made._getvalue()  # noqa: SLF001 (numba's own way to its value)

    return Lane(record)(record, types.intp), generate


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Lane

    def generic_resolve(self, lane: Lane, name: str) -> Any:
        field = lane.record.fields.get(name)
        return NUMBER if field is None or field.type.ndim == 1 else NUMBERS


@lower_getattr_generic(Lane)
def _read(context: Any, builder: Any, kind: Lane, value: Any, name: str) -> Any:
    field = kind.record.fields.get(name)
    if field is None:
        return context.get_constant(NUMBER, 0.0)
    own = cgutils.create_struct_proxy(kind)(context, builder, value)
    first = cgutils.pointer_add(builder, own.record, field.offset)
    first = builder.bitcast(first, context.get_value_type(NUMBER).as_pointer())
    first = builder.gep(first, [own.index])
    if field.type.ndim == 1:
        return builder.load(first)
    count, lanes = (context.get_constant(types.intp, size) for size in field.type.shape)
    size = context.get_constant(types.intp, BYTES)
    array = context.make_array(NUMBERS)(context, builder)
    stride = builder.mul(lanes, size)
    context.populate_array(
        array, data=first, shape=[count], strides=[stride], itemsize=size, meminfo=None
    )
    return array._getvalue()  # noqa: SLF001 (as above)


@compiled
def lane(record: Any, index: int) -> Any:
    """Return the parameters of machine `index` of a record; for compiled functions only."""
    return _lane(record, index)  # type: ignore[call-arg]  # numba gives the context
