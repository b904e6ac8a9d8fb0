"""In which order to visit places, from a start and not back to it: plain mathematics that the judge and who explores both call."""

from visiting_order.order import best_order, order_cost

__all__ = ["best_order", "order_cost"]
