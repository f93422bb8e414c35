"""libcosim, a co-simulation master: the closed loop from its SSP file. First: hovercraft-fmu build native_loop."""

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

execution = CosimExecution.from_ssp_file("build/HovercraftNativeLoop.ssp")  # the communication step is in it
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
craft = execution.slave_index_from_instance_name("hovercraft")
for minute in range(1, 6):
    execution.step(step_count=120)  # what it returns means nothing in version 0.0.4
    x, y = observer.last_real_values(craft, [3, 4])  # value references: the table of documentation/index.html
    print(f"after {minute} min: ({x:.1f}, {y:.1f}) m")
