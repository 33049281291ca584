"""The lab in a page: `abs_hil lab`."""
