#!/usr/bin/env python3
"""Compiles SPIR-V compute shaders with a Vulkan driver and prints what its compiler tells: registers, spills, memory of
threads, and how many subgroups fit a processor at a time.

No GPU is needed with Mesa's RADV, which compiles for a named chip without one:

    cargo run --release -p btf-viewer --example pass_spirv -- spirv cloth.spmm
    RADV_FORCE_FAMILY=navi31 VK_DRIVER_FILES=/usr/share/vulkan/icd.d/radeon_icd.json \\
        python3 tests/peers/shader_statistics.py spirv/*.spv

The name of a file is that of its entry point. Standard library only; the Vulkan loader is libvulkan.so.1."""

import ctypes
import pathlib
import struct
import sys
from ctypes import POINTER, Structure, byref, c_char, c_char_p, c_float, c_int, c_size_t, c_uint32, c_uint64, c_void_p

EXTENSION = b"VK_KHR_pipeline_executable_properties"
CAPTURE_STATISTICS = 0x40
COMPUTE = 0x20
UNIFORM_BUFFER, STORAGE_BUFFER = 6, 7
API_1_3 = (1 << 22) | (3 << 12)


def structure(name, *fields):
    """Declares a structure of Vulkan: its type's number, the next one, and its fields."""
    return type(name, (Structure,), {"_fields_": [("type", c_uint32), ("next", c_void_p), *fields]})


ApplicationInfo = structure("ApplicationInfo", ("application", c_char_p), ("version", c_uint32), ("engine", c_char_p),
                            ("engine_version", c_uint32), ("api", c_uint32))
InstanceInfo = structure("InstanceInfo", ("flags", c_uint32), ("application", POINTER(ApplicationInfo)),
                         ("layer_count", c_uint32), ("layers", c_void_p), ("extension_count", c_uint32),
                         ("extensions", c_void_p))
QueueInfo = structure("QueueInfo", ("flags", c_uint32), ("family", c_uint32), ("count", c_uint32),
                      ("priorities", POINTER(c_float)))
StatisticsFeature = structure("StatisticsFeature", ("on", c_uint32))
DeviceInfo = structure("DeviceInfo", ("flags", c_uint32), ("queue_count", c_uint32), ("queues", POINTER(QueueInfo)),
                       ("layer_count", c_uint32), ("layers", c_void_p), ("extension_count", c_uint32),
                       ("extensions", POINTER(c_char_p)), ("features", c_void_p))
ModuleInfo = structure("ModuleInfo", ("flags", c_uint32), ("size", c_size_t), ("code", c_char_p))
SetInfo = structure("SetInfo", ("flags", c_uint32), ("count", c_uint32), ("bindings", c_void_p))
LayoutInfo = structure("LayoutInfo", ("flags", c_uint32), ("count", c_uint32), ("sets", POINTER(c_void_p)),
                       ("range_count", c_uint32), ("ranges", c_void_p))
StageInfo = structure("StageInfo", ("flags", c_uint32), ("stage", c_uint32), ("module", c_void_p), ("name", c_char_p),
                      ("specialization", c_void_p))
PipelineInfo = structure("PipelineInfo", ("flags", c_uint32), ("stage", StageInfo), ("layout", c_void_p),
                         ("base", c_void_p), ("base_index", c_int))
ExecutableInfo = structure("ExecutableInfo", ("pipeline", c_void_p), ("index", c_uint32))
Statistic = structure("Statistic", ("name", c_char * 256), ("description", c_char * 256), ("format", c_uint32),
                      ("value", c_uint64))


class Binding(Structure):
    _fields_ = [("binding", c_uint32), ("type", c_uint32), ("count", c_uint32), ("stages", c_uint32), ("samplers", c_void_p)]


def check(result, what):
    if result:
        sys.exit(f"{what} failed with {result}; is there a Vulkan driver with {EXTENSION.decode()}?")


def bindings_of(words):
    """Returns the bindings of a SPIR-V module: (number, kind of buffer) by set."""
    sets, numbers, uniforms, at = {}, {}, set(), 5
    while at < len(words):
        operation, length = words[at] & 0xFFFF, words[at] >> 16
        if operation == 71 and words[at + 2] == 34:  # OpDecorate DescriptorSet
            sets[words[at + 1]] = words[at + 3]
        elif operation == 71 and words[at + 2] == 33:  # OpDecorate Binding
            numbers[words[at + 1]] = words[at + 3]
        elif operation == 59 and words[at + 3] == 2:  # OpVariable Uniform
            uniforms.add(words[at + 2])
        at += max(length, 1)
    found = {}
    for variable, number in numbers.items():
        kind = UNIFORM_BUFFER if variable in uniforms else STORAGE_BUFFER
        found.setdefault(sets[variable], set()).add((number, kind))
    return found


class Device:
    """The first device of the first driver."""

    def __init__(self):
        self.vulkan = ctypes.CDLL("libvulkan.so.1")
        application = ApplicationInfo(0, None, b"shader_statistics", 0, b"", 0, API_1_3)
        info, instance = InstanceInfo(1, None, 0, ctypes.pointer(application), 0, None, 0, None), c_void_p()
        check(self.vulkan.vkCreateInstance(byref(info), None, byref(instance)), "opening Vulkan")
        count = c_uint32()
        self.vulkan.vkEnumeratePhysicalDevices(instance, byref(count), None)
        devices = (c_void_p * count.value)()
        self.vulkan.vkEnumeratePhysicalDevices(instance, byref(count), devices)
        if count.value == 0:
            sys.exit("no Vulkan device; RADV_FORCE_FAMILY names a chip that RADV compiles for without one")
        properties = ctypes.create_string_buffer(4096)
        self.vulkan.vkGetPhysicalDeviceProperties(c_void_p(devices[0]), properties)
        self.name = properties.raw[20:276].split(b"\0")[0].decode()
        queue = QueueInfo(2, None, 0, 0, 1, (c_float * 1)(1.0))
        feature = StatisticsFeature(1000269000, None, 1)
        info = DeviceInfo(3, ctypes.cast(ctypes.pointer(feature), c_void_p), 0, 1, ctypes.pointer(queue), 0, None, 1,
                          (c_char_p * 1)(EXTENSION), None)
        self.device = c_void_p()
        check(self.vulkan.vkCreateDevice(c_void_p(devices[0]), byref(info), None, byref(self.device)), "opening the device")
        address = self.vulkan.vkGetDeviceProcAddr
        address.restype, address.argtypes = c_void_p, [c_void_p, c_char_p]
        prototype = ctypes.CFUNCTYPE(c_int, c_void_p, c_void_p, c_void_p, c_void_p)
        self.statistics = prototype(address(self.device, b"vkGetPipelineExecutableStatisticsKHR"))

    def made(self, function, info):
        handle = c_void_p()
        check(getattr(self.vulkan, function)(self.device, byref(info), None, byref(handle)), function)
        return handle

    def statistics_of(self, code, entry):
        """Returns what the compiler tells of an entry point, by name."""
        module = self.made("vkCreateShaderModule", ModuleInfo(16, None, 0, len(code), code))
        found = bindings_of(struct.unpack(f"<{len(code) // 4}I", code))
        sets = []
        for number in range(max(found, default=-1) + 1):
            listed = [Binding(binding, kind, 1, COMPUTE, None) for binding, kind in sorted(found.get(number, ()))]
            array = (Binding * max(1, len(listed)))(*listed)
            info = SetInfo(32, None, 0, len(listed), ctypes.cast(array, c_void_p))
            sets.append(self.made("vkCreateDescriptorSetLayout", info))
        layout = self.made("vkCreatePipelineLayout", LayoutInfo(30, None, 0, len(sets), (c_void_p * len(sets))(*sets), 0, None))
        stage = StageInfo(18, None, 0, COMPUTE, module, entry.encode(), None)
        info, pipeline = PipelineInfo(29, None, CAPTURE_STATISTICS, stage, layout, None, -1), c_void_p()
        made = self.vulkan.vkCreateComputePipelines(self.device, None, 1, byref(info), None, byref(pipeline))
        check(made, f"compiling {entry}")
        which, count = ExecutableInfo(1000269003, None, pipeline, 0), c_uint32()
        self.statistics(self.device, ctypes.cast(byref(which), c_void_p), ctypes.cast(byref(count), c_void_p), None)
        told = (Statistic * count.value)(*[Statistic(1000269004) for _ in range(count.value)])
        self.statistics(self.device, *(ctypes.cast(byref(x), c_void_p) for x in (which, count, told)))
        return {one.name.decode(): one.value for one in told}


def main():
    files = [pathlib.Path(name) for name in sys.argv[1:]]
    if not files:
        sys.exit(__doc__)
    device = Device()
    print(device.name)
    for file in files:
        code = file.read_bytes()
        if len(code) < 20 or struct.unpack("<I", code[:4])[0] != 0x07230203:
            sys.exit(f"{file}: is no SPIR-V; the example pass_spirv writes it")
        told = device.statistics_of(code, file.stem)
        print(file.stem, ", ".join(f"{name} {value}" for name, value in told.items() if "ash" not in name))


if __name__ == "__main__":
    main()
