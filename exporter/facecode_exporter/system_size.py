"""How large the networks of a system are, told before memory for them is asked for."""

from facecode_spec.schema import SystemSpec


def n_numbers(system: SystemSpec) -> int:
    """Numbers in the parts of a system, roughly; its speech encoder is left out."""
    total = 0
    for part in system.parts:
        for block in (part.cross_modal_decoder, part.motion_decoder):
            if block is not None:
                layer = 4 * block.dim**2 + 2 * block.dim * block.dim_feedforward
                total += block.n_layers * layer + 6 * system.n_vertices * block.dim
        if part.codebook is not None:
            total += part.codebook.n_codes * part.codebook.dim
    return total
