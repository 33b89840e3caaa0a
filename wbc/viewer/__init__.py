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
    from wbc.viewer.beside import Viewer as Viewer, show as show
    from wbc.viewer.errors import ViewerError as ViewerError
    from wbc.viewer.messages import MessageError as MessageError
    from wbc.viewer.operation import Operation as Operation
    from wbc.viewer.paced import run as run
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
