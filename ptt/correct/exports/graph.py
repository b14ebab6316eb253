"""Building an ONNX graph by operators: every operation on a node makes one node."""

from typing import Any

import numpy as np


class Graph:
    """Nodes and constants of a graph under construction."""

    def __init__(self) -> None:
        import onnx.helper
        import onnx.numpy_helper

        self.helper, self._numpy = onnx.helper, onnx.numpy_helper
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, value: Any, dtype: type = np.float64) -> "Node":
        """A constant array."""
        name = f"c{len(self.constants)}"
        self.constants.append(self._numpy.from_array(np.ascontiguousarray(value, dtype=dtype), name))
        return Node(self, name)

    def node(self, operation: str, *inputs: Any, **attributes: Any) -> "Node":
        """One operation on values, numbers or arrays."""
        names = [self.value(each).name for each in inputs]
        name = f"v{len(self.nodes)}"
        self.nodes.append(self.helper.make_node(operation, names, [name], **attributes))
        return Node(self, name)

    def value(self, item: Any) -> "Node":
        """A node as it is; anything else as a constant."""
        return item if isinstance(item, Node) else self.constant(item)


class Node:
    """The output of a node, or an input of the graph."""

    __array_ufunc__ = None  # numpy arrays leave binary operations to this class

    def __init__(self, graph: Graph, name: str) -> None:
        self.graph, self.name = graph, name

    def __add__(self, other: Any) -> "Node":
        return self.graph.node("Add", self, other)

    def __sub__(self, other: Any) -> "Node":
        return self.graph.node("Sub", self, other)

    def __mul__(self, other: Any) -> "Node":
        return self.graph.node("Mul", self, other)

    def __truediv__(self, other: Any) -> "Node":
        return self.graph.node("Div", self, other)

    def __matmul__(self, other: Any) -> "Node":
        return self.graph.node("MatMul", self, other)

    def __radd__(self, other: Any) -> "Node":
        return self.graph.node("Add", other, self)

    def __rsub__(self, other: Any) -> "Node":
        return self.graph.node("Sub", other, self)

    def __rmul__(self, other: Any) -> "Node":
        return self.graph.node("Mul", other, self)

    def __neg__(self) -> "Node":
        return self.graph.node("Neg", self)

    def sqrt(self) -> "Node":
        """Square root."""
        return self.graph.node("Sqrt", self)

    def abs(self) -> "Node":
        """Magnitude."""
        return self.graph.node("Abs", self)

    def take(self, *columns: int) -> "Node":
        """Columns of (n, m), (n, len(columns))."""
        return self.graph.node("Gather", self, self.graph.constant(columns, np.int64), axis=1)

    def sum(self) -> "Node":
        """Sum along each row, (n, 1)."""
        return self.graph.node("ReduceSum", self, self.graph.constant([1], np.int64), keepdims=1)
