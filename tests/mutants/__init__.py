"""Would the tests notice? One thing is changed in a file of C or Python, and those tests run that may tell.

An own tool of three files, because no well-kept one draws one sample of both languages: mutmut and cosmic-ray know
Python alone (and mutmut what stands in functions alone), universalmutator knows both, but starts a process for each.
"""
