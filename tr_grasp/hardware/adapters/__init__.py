"""Real devices behind the hardware protocols. Nothing here is imported until a device is opened.

:func:`tr_grasp.hardware.devices.open_station` opens them by name. Each adapter has three parts: a *link* that speaks
the device's own language and units, :class:`~tr_grasp.hardware.adapters.streamed_arm.StreamedArm` or
:class:`~tr_grasp.hardware.adapters.polled_gripper.PolledGripper`, which are the same for all, and settings.
"""
