"""Our own plug-ins: declarations alone, whose code is imported when it is used."""

from missions.plugin import Plugin

PLUGINS = (Plugin("testing", services={"faults": "missions.plugins.testing.faults:Faults"}),)
