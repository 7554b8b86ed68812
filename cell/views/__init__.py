"""What a person sees: report, live page, running estimate, terminal; imports devices and below."""
