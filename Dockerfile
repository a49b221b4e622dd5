FROM python:3.13-slim

WORKDIR /app
COPY requirements/runtime.txt requirements/runtime.txt
RUN pip install --no-cache-dir --only-binary :all: --require-hashes -r requirements/runtime.txt \
 && pip install --no-cache-dir --only-binary :all: hatchling editables
COPY . .
RUN pip install --no-cache-dir --no-deps --no-build-isolation --no-index . \
 && useradd --create-home loopwright && mkdir /data && chown loopwright /data

USER loopwright
ENV LOOPWRIGHT_DATA=/data
VOLUME /data
EXPOSE 8000
CMD ["loopwright", "serve", "--host", "0.0.0.0"]
