"""From the keys of a robot file to a camera."""

from drivers.api import Camera
from drivers.api.driver import Site
from drivers.api.senses import CameraKeys
from drivers.camera.choose import open_source


def make(keys: CameraKeys, site: Site) -> Camera:
    """Return the camera on the source of the keys: an index, a device, a file, a URL or a folder."""
    return open_source(
        keys.source,
        site.clock,
        field_of_view=keys.field_of_view,
        size=(keys.width, keys.height),
        report=site.report,
    )
