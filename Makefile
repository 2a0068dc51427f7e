# Two commands; what they run stands in README.md and in .ci/.
.PHONY: reproduce test environment

reproduce: environment
	@.venv/bin/tbdcore run
	@.venv/bin/tbdcore score

test:
	@sh .ci/test

environment:
	@sh .ci/environment
