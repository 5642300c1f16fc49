"""The base class of the BSDFs in this folder."""

from typing import Any


def base_class(mi: Any) -> Any:
    """A class for the current variant: a BSDF that wraps another one, as far as its subclass does
    not override it."""

    class PluginBSDF(mi.BSDF):  # type: ignore[misc]
        """A subclass defines `sample` and `eval`, and calls `wrap` when it is made."""

        def wrap(self, nested: Any) -> None:
            """Have the components of another BSDF."""
            self.nested = nested
            self.m_components = [nested.flags(k) for k in range(nested.component_count())]
            self.m_flags = nested.flags()

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.nested.pdf(context, si, wo, active)

        def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def to_string(self) -> str:
            return f"{type(self).__name__}[{self.nested}]"

    return PluginBSDF
