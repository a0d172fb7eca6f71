# An extra that is looked for and never called here: TorchRL does.
