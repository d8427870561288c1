"""A reader of .glb files from the specification alone, for tests: it shares no code with ours."""

import json
import struct

import numpy as np

DTYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class Glb:
    """The JSON, the binary chunk, and the chunks after it."""

    def __init__(self, data):
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        chunks, position = [], 12
        while position < len(data):
            size, kind = struct.unpack_from("<I4s", data, position)
            assert size % 4 == 0
            chunks.append((kind, data[position + 8 : position + 8 + size]))
            position += 8 + size
        assert position == len(data)
        assert chunks[0][0] == b"JSON"
        self.text = chunks[0][1]
        self.tree = json.loads(self.text)
        has_binary = len(chunks) > 1 and chunks[1][0] == b"BIN\0"
        self.binary = chunks[1][1] if has_binary else b""
        self.further = chunks[2:] if has_binary else chunks[1:]
        for index, each in enumerate(self.tree.get("accessors", [])):
            values = self.accessor(index)
            for bound, found in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
                if bound in each:
                    assert each[bound] == found.tolist()

    def view(self, index):
        view = self.tree["bufferViews"][index]
        assert view["buffer"] == 0
        start = view.get("byteOffset", 0)
        end = start + view["byteLength"]
        assert end <= self.tree["buffers"][0]["byteLength"] <= len(self.binary)
        return self.binary[start:end]

    def _array(self, view, component, count, kind):
        start = self.tree["bufferViews"][view].get("byteOffset", 0)
        dtype = np.dtype(DTYPES[component])
        assert start % max(dtype.itemsize, 4) == 0
        return np.frombuffer(self.view(view), dtype, count * WIDTHS[kind]).reshape(count, -1)

    def accessor(self, index):
        """(count, n), sparse ones filled in, normalised ones as shares."""
        said = self.tree["accessors"][index]
        component, count, kind = said["componentType"], said["count"], said["type"]
        if "bufferView" in said:
            values = self._array(said["bufferView"], component, count, kind).copy()
        else:
            values = np.zeros((count, WIDTHS[kind]), DTYPES[component])
        if "sparse" in said:
            some = said["sparse"]
            where = some["indices"]
            at = self._array(where["bufferView"], where["componentType"], some["count"], "SCALAR")
            assert (np.diff(at[:, 0].astype(int)) > 0).all()
            values[at[:, 0]] = self._array(
                some["values"]["bufferView"], component, some["count"], kind
            )
        return values / np.iinfo(values.dtype).max if said.get("normalized") else values

    def mesh_of(self, node):
        return self.tree["meshes"][self.tree["nodes"][node]["mesh"]]

    def attribute(self, node, name):
        return self.accessor(self.mesh_of(node)["primitives"][0]["attributes"][name])

    def weights(self, node, animation=0):
        """(T,) seconds and (T, n_targets) of the channel that moves the node's weights."""
        moves = self.tree["animations"][animation]
        target = {"node": node, "path": "weights"}
        (channel,) = [each for each in moves["channels"] if each["target"] == target]
        sampler = moves["samplers"][channel["sampler"]]
        assert sampler.get("interpolation", "LINEAR") == "LINEAR"
        times, keys = self.accessor(sampler["input"])[:, 0], self.accessor(sampler["output"])
        return times, keys.reshape(len(times), -1)

    def positions(self, node, animation=0):
        """(T, V, 3) in the world, at the keys of the animation."""
        targets = self.mesh_of(node)["primitives"][0]["targets"]
        deltas = np.stack([self.accessor(target["POSITION"]) for target in targets])
        moved = np.tensordot(self.weights(node, animation)[1], deltas, 1)
        place = self.tree["nodes"][node].get("translation", [0, 0, 0])
        return self.attribute(node, "POSITION") + moved + np.float32(place)
