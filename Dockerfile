# One image for coordinator, workers and query workers; docker-compose.yml says which it is.
FROM python:3.12-slim AS build
WORKDIR /src
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY contracts contracts
COPY geo geo
COPY retrieval retrieval
COPY index index
COPY survey survey
COPY workers workers
COPY coordinator coordinator
RUN python -m venv /venv && /venv/bin/pip install --no-cache-dir --constraint constraints.txt '.[s3]'

FROM python:3.12-slim
RUN useradd --create-home --uid 1000 flaneur \
    && install -d -o flaneur -g flaneur /index /results
COPY --from=build /venv /venv
ENV PATH=/venv/bin:$PATH PYTHONUNBUFFERED=1
USER flaneur
WORKDIR /results
ENTRYPOINT ["flaneur"]
CMD ["--help"]
