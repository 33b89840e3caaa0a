"""See a controller and drive it, in a browser. See docs/viewer.md.

viewer = wbc.viewer.show(controller)
while viewer.running:
    step = controller.step(q)
    viewer.update(step)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.viewer.beside import Viewer, show
    from wbc.viewer.errors import ViewerError
    from wbc.viewer.messages import MessageError
    from wbc.viewer.operation import Operation
    from wbc.viewer.paced import run
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = ["MessageError", "Operation", "Viewer", "ViewerError", "run", "show"]
