"""Who made a unit and what it is, by its own words: function 2BH/0EH. No unit has to know it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from drivebus import _native

__all__ = ["DeviceIdentification", "device_of"]


@dataclass(frozen=True)
class DeviceIdentification:
    """Who made a unit and what it is, as it says itself. None where it does not say it.

    Attributes:
        unit: Its address.
        vendor: The maker (object 00H).
        product_code: The maker's code for the product (01H).
        revision: Major and minor revision (02H).
        vendor_url: The maker's page (03H).
        product_name: The product (04H).
        model_name: The model (05H).
        application_name: The user's own name for what it does (06H).
        objects: All of them as bytes, by their numbers. From 80H on they are the maker's own, and need not be text.
        conformity: What the unit says that it has: 1 basic, 2 regular, 3 extended; 80H more where it also gives single
            objects.
        complete: Whether that is all that the unit has. It is not where the unit goes on without an end.
    """

    unit: int
    vendor: str | None
    product_code: str | None
    revision: str | None
    vendor_url: str | None
    product_name: str | None
    model_name: str | None
    application_name: str | None
    objects: Mapping[int, bytes] = field(hash=False)
    conformity: int
    complete: bool

    def __str__(self) -> str:
        told = [self.vendor, self.product_name or self.model_name, self.product_code, self.revision]
        return f"unit {self.unit}: {', '.join(text for text in told if text) or 'does not say what it is'}"


def device_of(unit: int, question: _native.DeviceQuestion) -> DeviceIdentification:
    """What *unit* told to *question*."""
    conformity, complete, texts, objects = question.told()
    vendor, product_code, revision, vendor_url, product_name, model_name, application_name = texts
    return DeviceIdentification(
        unit=unit,
        vendor=vendor,
        product_code=product_code,
        revision=revision,
        vendor_url=vendor_url,
        product_name=product_name,
        model_name=model_name,
        application_name=application_name,
        objects=MappingProxyType(objects),
        conformity=conformity,
        complete=complete,
    )
